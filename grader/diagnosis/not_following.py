"""Messages that do not hold the values of those that they are made of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import median_high
from typing import Any

from grader.diagnosis.explanation import Symptom, explanation, mistaken
from grader.findings.finding import Finding
from grader.findings.value import leaves, number_at
from grader.findings.words import MATH, code, codes, listing
from grader.measure.derived_messages import DerivedMessages, Sample
from grader.recording.model import NS
from grader.spec.expression import Expression
from grader.spec.unit import format_duration

_MOST_EXPLAINED = 100
# Share of the messages for which an explanation must hold.
_NEARLY_ALL = 0.9
_QUATERNION = ("x", "y", "z", "w")


@dataclass(frozen=True)
class NotFollowing(Symptom[Finding]):
    """Messages do not hold the values of another topic.

    Attributes:
        source: That topic, marked as code.
        wrong: Those of the judged messages that are; at least one.
    """

    source: str
    derived: DerivedMessages
    judged: list[Sample]
    wrong: list[Sample]

    @cached_property
    def examples(self) -> list[Sample]:
        """Wrong messages, not too many."""
        return _thinned(self.wrong)

    @cached_property
    def wrong_fields(self) -> list[int]:
        """The fields that are wrong in one of the examples."""
        return [
            index
            for index in range(len(self.derived.fields))
            if not all(self.derived.fitting(sample.errors, index) for sample in self.examples)
        ]

    @cached_property
    def ages_s(self) -> list[float] | None:
        """How old the values of each example are, if all of them are those of an older source."""
        ages_s, derived = [], self.derived
        for sample in self.examples:
            older = derived.fitting(derived.errors(sample.values, range(sample.window[0])))
            if not older:
                return None
            ages_s.append((sample.message.stamp_ns - derived.sources[older[-1]].stamp_ns) / NS)
        first_values = [sample.values[0] for sample in self.examples]
        # A value that never changes is old as well, but that says less.
        never_changes = len(ages_s) > 1 and spread(first_values) <= derived.tolerances[0]
        return None if never_changes else ages_s


@explanation(NotFollowing)
def older_values(symptom: NotFollowing) -> Finding | None:
    """The values are those of an older message: a timer or a sleep holds the newest one up."""
    ages_s, source = symptom.ages_s, symptom.source
    if ages_s is None:
        return None
    age = format_duration(median_high(ages_s))
    return mistaken(
        "older_values", f"the values are those of {source} {age} earlier", source=source
    )


@explanation(NotFollowing)
def different_moments(symptom: NotFollowing) -> Finding | None:
    """The fields are filled from different messages."""
    if symptom.wrong_fields:
        return None
    return mistaken("different_moments", f"the values are of different moments of {symptom.source}")


@explanation(NotFollowing, general=True)
def other_values(symptom: NotFollowing) -> Finding:
    """Fields hold something else: another field, a quaternion, degrees, a wrong sign."""
    derived, sample = symptom.derived, symptom.wrong[len(symptom.wrong) // 2]
    newest = derived.table[sample.window[-1]]
    by_clause: dict[str, list[str]] = {}
    for index in symptom.wrong_fields:
        field, value = code(derived.fields[index]), f"{sample.values[index]:.4g}"
        text = f"{field} = {value} instead of {newest[index]:.4g}"
        by_clause.setdefault(_what_it_is(symptom, index), []).append(text)
    return mistaken(
        "other_values",
        "; ".join(listing(texts) + clause for clause, texts in by_clause.items()),
        fields=codes(derived.fields[index] for index in symptom.wrong_fields),
        source=symptom.source,
        values=codes(derived.values[index] for index in symptom.wrong_fields),
    )


def _what_it_is(symptom: NotFollowing, index: int) -> str:
    """What stands in a wrong field, as a clause; empty where the messages do not tell.

    It must be in nearly all messages, and in nearly all of those in which the field is wrong: of a
    number that is not negative, what has lost its sign is right as well.
    """
    derived, judged = symptom.derived, _thinned(symptom.judged)
    numbers = [sample.values[index] for sample in judged]
    if not all(map(math.isfinite, numbers)):
        is_in_array = "[" in derived.fields[index]
        short = ", or not there at all: the array is too short" if is_in_array else ""
        return f": not a finite number{short}"
    if len(numbers) > 1 and spread(numbers) <= 0.0:
        return ": no change from message to message"
    wrong = [one for one in symptom.examples if not derived.fitting(one.errors, index)]
    rows = sorted({row for sample in (*judged, *wrong) for row in sample.window})
    tolerance = derived.tolerances[index]
    by_source = [_mistakes(derived.values[index], derived.sources[row].value) for row in rows]
    # Arrays of the sources may have other lengths, which come last: those are left out.
    for same_mistake in zip(*by_source, strict=False):
        series = {row: number for row, (_, number) in zip(rows, same_mistake, strict=True)}
        if spread(list(series.values())) <= tolerance:
            continue
        shares = [_share(samples, index, series, tolerance) for samples in (judged, wrong)]
        if min(shares) >= _NEARLY_ALL:
            return f": it is {same_mistake[0][0]}"
    return ""


def _thinned(samples: list[Sample]) -> list[Sample]:
    """Some of many messages, in equal distances."""
    return samples[:: max(1, len(samples) // _MOST_EXPLAINED)]


def spread(numbers: Sequence[float]) -> float:
    """How far apart the least and the greatest number are."""
    return max(numbers) - min(numbers)


def _share(
    samples: list[Sample], index: int, series: Mapping[int, float], tolerance: float
) -> float:
    """Share of the messages in which a field holds one of the numbers of a mistake."""
    hits = sum(
        any(abs(sample.values[index] - series[row]) <= tolerance for row in sample.window)
        for sample in samples
    )
    return hits / len(samples)


def _mistakes(value: str, message: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """What students take instead: words that end the sentence "it is ...", and the number.

    The words of all messages of a type are the same, in the same order, as far as their arrays
    have the same length.
    """
    right = number_at(message, value)
    quaternion = "".join(Expression.of(value).fields)
    if value.replace(" ", "") == f"yaw({quaternion})":
        x, y, z, w = (number_at(message, f"{quaternion}.{part}") for part in _QUATERNION)
        for part, number in zip(_QUATERNION, (x, y, z, w), strict=True):
            yield f"`{part}` of the quaternion, which is no angle: convert the quaternion", number
        yield "the yaw in degrees: ROS has angles in radians (REP-103)", math.degrees(right)
        yield "the yaw with the wrong sign", -right
        yield "half of the yaw: atan2(z, w) is half of the angle", math.atan2(z, w)
        turn = 2.0 * math.acos(max(-1.0, min(1.0, w)))
        yield "2 acos(w), which has lost the sign of the yaw", turn
        turn = 2.0 * math.asin(max(-1.0, min(1.0, z)))
        yield f"2 asin(z), which is wrong where w is negative: use {MATH}atan2", turn
        turn = math.atan(math.tan(right))
        words = f"the yaw in a wrong quadrant: use {MATH}atan2(a, b), not {MATH}atan(a / b)"
        yield words, turn
    else:
        yield f"`{value}` with the wrong sign", -right
        yield f"`{value}` without its sign, as from {MATH}hypot() or abs()", abs(right)
    for path, number in leaves(message).items():
        if path != value and isinstance(number, int | float):
            yield f"`{path}`", float(number)
