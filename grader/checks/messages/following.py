"""Check of messages that are made of other messages: their values follow them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from pydantic import Field

from grader.checks.check import NamedFields, Parameters, Subject, check, toleranced
from grader.checks.messages.derived_messages import DerivedMessages, Sample, mistakes
from grader.checks.need import Recorded
from grader.diagnosis.no_messages import why_few, why_silent
from grader.findings.fields import FieldTolerance, within_words
from grader.findings.finding import Evidence, Finding, Moment, Plot
from grader.findings.value import FieldPath
from grader.findings.wording import code, codes, counted, listing
from grader.recording.model import NS, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

# A source that varies by fewer tolerances cannot tell a right value from a wrong one.
_CONCLUSIVE = 4.0
_MOST_EXPLAINED = 100
# Share of the messages for which an explanation must hold.
_NEARLY_ALL = 0.9


class Follows(Parameters):
    """Parameters of messages.follows."""

    about = ("published", "subscription")
    needs = (Recorded(), Recorded("source"))

    topic: TopicName = Field(description="Topic of the messages that are judged.")
    source: TopicName = Field(description="Recorded topic that their values come from.")
    fields: dict[FieldPath, FieldPath] = Field(
        min_length=1,
        description="Field of the judged message -> where its value comes from: a field of the "
        "source, or an expression such as `yaw(pose.pose.orientation)`.",
    )
    tolerance: FieldTolerance
    within: Duration = Field(0.5, description="Largest age of the values.", validate_default=False)
    settle: Duration = Field(
        2.0,
        description="For this time after the first message of the source, a node may still publish "
        "older values.",
        validate_default=False,
    )
    at_least: int = Field(5, ge=1, description="Least number of messages needed to judge.")

    def _asked(self) -> str:
        pairs = listing(f"{code(field)} = {code(value)}" for field, value in self.fields.items())
        of = f"the values of {code(self.source)}: {pairs}{within_words(self.tolerance)}"
        return f"on {code(self.topic)} {of}"

    def named_fields(self) -> Iterator[NamedFields]:
        """The judged fields, and those of the source."""
        for field, text in self.fields.items():
            yield NamedFields(("fields", field), self.topic, field)
            yield NamedFields(("fields", field), self.source, text)
        yield from toleranced("fields", self.topic, {}, self.tolerance)


@check("messages.follows", Subject.RECORDING, Follows)
def follows(recording: Recording, parameters: Follows) -> Finding:
    """The values of the messages follow those of another topic.

    Every message must hold the values of one message of the source that was published at most
    `within` before it. Delays of the machine do not count. Angles are compared on the circle. What
    is published before the first message of the source does not count.
    """
    source = code(parameters.source)
    messages, sources = recording.on(parameters.topic), recording.on(parameters.source)
    if not messages:
        return why_silent(recording, parameters.topic)
    if not sources:
        return Finding.ours(f"nothing was recorded on {source}, so it cannot be judged")
    derived = DerivedMessages.of(sources, parameters.fields, parameters.tolerance)
    samples = derived.samples(recording, messages, parameters.within)
    columns = zip(derived.tolerances, zip(*derived.table, strict=True), strict=True)
    if not all(_spread(column) > _CONCLUSIVE * tolerance for tolerance, column in columns):
        return Finding.ours(f"the values on {source} hardly change: it cannot be judged")
    right = {sample.number for sample in samples if derived.fitting(sample.errors)}
    judged = _judged(recording, parameters, samples, right)
    if len(judged) < parameters.at_least:
        if len(messages) < parameters.at_least:
            return why_few(recording, parameters.topic, parameters.at_least)
        last_s = recording.since_launch_s(messages[-1].stamp_ns)
        return Finding(
            f"of {counted(len(messages), 'message')} only {len(judged)} came after the first one "
            f"on {source}",
            f"Publish from the callback of {source}, or from a timer that goes on.",
            Evidence(moments=(Moment("the last message", last_s),)),
        )
    wrong = [sample for sample in judged if sample.number not in right]
    if wrong:
        return _failure(recording, source, derived, judged, wrong)
    late = [one for one in judged if not derived.fitting(one.errors[one.excused :])]
    # Where the machine took nothing, no message is excused: most of them decide for all.
    undisturbed = sum(not one.excused for one in judged)
    if late and undisturbed < max(parameters.at_least, len(judged) / 2):
        return Finding.undecided(
            f"{len(late)} of {counted(len(judged), 'message')} have older values, but the machine "
            "took the time from the process"
        )
    plots = tuple(_plot(recording, derived, judged, index) for index in range(len(derived.fields)))
    seen = f"right in all of {counted(len(judged), 'message')}"
    return Finding.passed(parameters.asked_for, seen, Evidence(plots=plots))


def _judged(
    recording: Recording, parameters: Follows, samples: list[Sample], right: set[int]
) -> list[Sample]:
    """The messages that count."""
    # One that fits nothing may be made of a message that was not recorded.
    known = [sample for sample in samples if sample.is_known or sample.number in right]
    begin_ns = recording.on(parameters.source)[0].stamp_ns
    settled_ns = begin_ns + round(parameters.settle * NS)
    settled_ns += round(recording.stolen_s(begin_ns, settled_ns) * NS)
    first = next((index for index, sample in enumerate(known) if sample.number in right), 0)
    if first and known[first - 1].message.stamp_ns > settled_ns:
        first = 0
    return known[first:]


def _failure(
    recording: Recording,
    source: str,
    derived: DerivedMessages,
    judged: list[Sample],
    wrong: list[Sample],
) -> Finding:
    sample = wrong[len(wrong) // 2]
    newest = derived.table[sample.window[-1]]
    some = wrong[:: max(1, len(wrong) // _MOST_EXPLAINED)]
    seen = judged[:: max(1, len(judged) // _MOST_EXPLAINED)]
    bad = [
        index
        for index in range(len(derived.fields))
        if not all(derived.fitting(one.errors, index) for one in some)
    ]
    late_s = _lag_s(derived, some)
    if late_s is not None:
        observed = f"the values are those of {source} {format_duration(late_s)} earlier"
        hint = (
            f"Publish from the callback of {source}, or store its newest message there and "
            "publish that. A callback that sleeps lets the newer ones wait."
        )
    elif not bad:
        observed = f"the values are of different moments of {source}"
        hint = "Fill all fields from one message: `msg` of the callback."
    else:
        fields = [
            f"{code(derived.fields[index])} = {sample.values[index]:.4g} instead of "
            f"{newest[index]:.4g}"
            for index in bad
        ]
        by_clause: dict[str, list[str]] = {}
        for index, text in zip(bad, fields, strict=True):
            by_clause.setdefault(_explanation(derived, seen, some, index), []).append(text)
        observed = "; ".join(listing(texts) + clause for clause, texts in by_clause.items())
        hint = (
            f"Set {codes(derived.fields[index] for index in bad)} in the callback of {source}, "
            f"from {codes(derived.values[index] for index in bad)} of its message."
        )
    when_s = recording.since_launch_s(sample.message.stamp_ns)
    shown = bad or range(len(derived.fields))
    return Finding(
        f"{observed} ({len(wrong)} of {counted(len(judged), 'message')} wrong)",
        hint,
        Evidence(
            moments=(Moment(f"message {sample.number} is wrong", when_s),),
            plots=tuple(_plot(recording, derived, judged, index) for index in shown),
        ),
    )


def _lag_s(derived: DerivedMessages, wrong: list[Sample]) -> float | None:
    """How old the values are, if all wrong messages have those of an older source."""
    ages = []
    for sample in wrong:
        older = derived.fitting(derived.errors(sample.values, range(sample.window[0])))
        if not older:
            return None
        ages.append((sample.message.stamp_ns - derived.sources[older[-1]].stamp_ns) / NS)
    still = _spread([sample.values[0] for sample in wrong]) <= derived.tolerances[0]
    # A value that never changes is old as well, but that says less.
    return None if still and len(wrong) > 1 else sorted(ages)[len(ages) // 2]


def _explanation(
    derived: DerivedMessages, seen: list[Sample], wrong: list[Sample], index: int
) -> str:
    """What stands in a wrong field, as a clause; empty where the messages do not tell.

    It must be in nearly all messages, and in nearly all of those in which the field is wrong: of a
    number that is not negative, what has lost its sign is right as well.
    """
    numbers = [sample.values[index] for sample in seen]
    if not all(map(math.isfinite, numbers)):
        short = ", or not there at all: the array is too short"
        return f": not a finite number{short if '[' in derived.fields[index] else ''}"
    if len(numbers) > 1 and _spread(numbers) <= 0.0:
        return ": no change from message to message"
    wrong = [sample for sample in wrong if not derived.fitting(sample.errors, index)]
    rows = sorted({row for sample in (*seen, *wrong) for row in sample.window})
    tolerance = derived.tolerances[index]
    found = [mistakes(derived.values[index], derived.sources[row].value) for row in rows]
    # Arrays of the sources may have other lengths, which come last: those are left out.
    for same_mistake in zip(*found, strict=False):
        series = {row: number for row, (_, number) in zip(rows, same_mistake, strict=True)}
        if _spread(list(series.values())) > tolerance and all(
            _share(samples, index, series, tolerance) >= _NEARLY_ALL for samples in (seen, wrong)
        ):
            return f": it is {same_mistake[0][0]}"
    return ""


def _spread(numbers: Sequence[float]) -> float:
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


def _plot(recording: Recording, derived: DerivedMessages, judged: list[Sample], index: int) -> Plot:
    field = derived.fields[index]
    # The least error is that of the source that the value comes from.
    errors = [min((row[index] for row in sample.errors), key=abs) for sample in judged]
    finite = [(s, e) for s, e in zip(judged, errors, strict=True) if math.isfinite(e)]
    return Plot(
        f"{field}: how far it is off",
        "time since launch (s)",
        f"error of {field}",
        tuple(recording.since_launch_s(sample.message.stamp_ns) for sample, _ in finite),
        tuple(error for _, error in finite),
        (-derived.tolerances[index], derived.tolerances[index]),
    )
