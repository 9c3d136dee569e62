"""What a wrong rhythm of messages tells: wrong units, two timers, sleeping, a slow callback."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import mean

from grader.checks.timing.period import Interval, PeriodLimits, PeriodVerdict, judge
from grader.diagnosis.process.blocked_executor import long_wait
from grader.measure import declarations
from grader.recording.model import Kind, Recording
from grader.spec.unit import format_duration

_TENS = (10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
_TENS_TOLERANCE = 0.1
# Milliseconds and microseconds.
_UNITS = (1e3, 1e6)
_MOST_TIMES = 5
_TIMES_TOLERANCE = 0.08
_SAME = 0.05
# Share of the period.
_AT_ONCE = 0.1
# So many timers of one period are not made by hand.
_MADE_ANEW = 4
_WORDS = {2: "twice", 3: "three times", 4: "four times", 5: "five times"}
_ORDINALS = {2: "second", 3: "third"}
_ONE_TIMER = "Create one timer in the constructor, once, and publish once in its callback."


@dataclass(frozen=True)
class Explanation:
    """What stands behind it.

    Attributes:
        words: A clause to follow the figures, or empty.
    """

    words: str
    hint: str


def explain(
    recording: Recording,
    topic: str,
    measured: tuple[Interval, ...],
    verdict: PeriodVerdict,
    limits: PeriodLimits,
) -> Explanation:
    """Explain why the rhythm is not the expected one.

    Args:
        measured: Intervals, at least one.
    """
    declared = [timer.period_s for timer in declarations.timers(recording)]
    often = _too_often(recording, topic, measured, verdict, limits, declared)
    if often:
        return often
    if verdict.period_good:
        return _irregular(measured, verdict, declared)
    return _wrong_period(recording, topic, verdict, limits, declared)


def is_declared(recording: Recording, verdict: PeriodVerdict, limits: PeriodLimits) -> bool:
    """Whether the process declared a wrong period that is the median, and no right one.

    A hold-up moves single messages of a timer, never its period: then it is not the machine's
    doing.
    """
    declared = [timer.period_s for timer in declarations.timers(recording)]
    right = [item for item in declared if judge([item], limits).period_good]
    return (
        not verdict.period_good
        and not right
        and any(math.isclose(item, verdict.median_s, rel_tol=_SAME) for item in declared)
    )


def _too_often(
    recording: Recording,
    topic: str,
    measured: tuple[Interval, ...],
    verdict: PeriodVerdict,
    limits: PeriodLimits,
    declared: list[float],
) -> Explanation | None:
    """Several messages in each expected period, evenly spaced or not."""
    average_s = mean(item.seconds for item in measured)
    if average_s <= 0.0:
        return None
    ratio = limits.period_s / average_s
    times = round(ratio)
    # A burst that the observation cut in two leaves the average off by some messages.
    cut = 0.0 if verdict.regular else times * (times - 1) / len(measured)
    if not 2 <= times <= _MOST_TIMES or abs(ratio - times) > _TIMES_TOLERANCE * times + cut:
        return None
    words = f"messages come {_WORDS[times]} as often as expected"
    publishers = len(recording.student_endpoints(Kind.PUBLISHER, topic))
    if publishers > 1:
        return Explanation(
            f"{words}, from {publishers} publishers on the topic",
            "Create one publisher and launch the node once.",
        )
    if len(declared) > 1:
        return Explanation(f"{words}, and the process declared {len(declared)} timers", _ONE_TIMER)
    if declared and math.isclose(declared[0], average_s, rel_tol=_SAME):
        return Explanation(
            f"{words}: the process declared a timer of {format_duration(declared[0])}",
            _seconds_hint(limits),
        )
    return Explanation(words, _ONE_TIMER)


def _wrong_period(
    recording: Recording,
    topic: str,
    verdict: PeriodVerdict,
    limits: PeriodLimits,
    declared: list[float],
) -> Explanation:
    wanted_s, median_s = limits.period_s, verdict.median_s
    wanted, found = format_duration(wanted_s), format_duration(median_s)
    same = next((item for item in declared if math.isclose(item, median_s, rel_tol=_SAME)), None)
    said = f"; the process declared a timer of {format_duration(same)}" if same else ""
    for factor in _TENS:
        for ratio, words in ((factor, "times"), (1.0 / factor, "of")):
            if median_s > 0.0 and math.isclose(median_s / wanted_s, ratio, rel_tol=_TENS_TOLERANCE):
                amount = f"{factor:g} times" if words == "times" else f"1/{factor:g} of"
                return Explanation(f"{amount} the expected period{said}", _seconds_hint(limits))
    if same:
        return Explanation(said.removeprefix("; "), _seconds_hint(limits))
    for factor in _UNITS:
        short_s = next((x for x in declared if math.isclose(x * factor, wanted_s)), None)
        if short_s is not None and short_s < median_s < wanted_s:
            return Explanation(
                f"the process declared a timer of {format_duration(short_s)}, 1/{factor:g} of the "
                "expected period, and its callback is not called that often",
                _seconds_hint(limits),
            )
    skipped = _skipped(recording, declared, verdict, limits)
    if skipped is not None:
        return skipped
    if median_s < wanted_s:
        return _too_fast(recording, topic, limits)
    longer = format_duration(median_s - wanted_s)
    right = [item for item in declared if math.isclose(item, wanted_s, rel_tol=_SAME)]
    if len(right) >= _MADE_ANEW:
        return Explanation(
            f"{longer} too long: the process declared {len(right)} timers of {wanted}, as if the "
            "callback made a new one each time",
            "Create one timer in the constructor: it goes on by itself, and keeps its period "
            "whatever the callback needs.",
        )
    if right and verdict.regular and _comes_round(recording, limits):
        return Explanation(
            f"{longer} too long, although the executor is not blocked: the timer of {wanted} "
            "is started anew after its callback was called",
            "timer.reset() lets the period begin anew: without it the timer goes on by itself, and "
            "keeps its period whatever the callback needs.",
        )
    if right:
        return Explanation(
            f"{longer} too long: the process declared a timer of {wanted}, but the executor "
            "does not call it in time",
            "Keep callbacks short: no sleep, no loop that waits, no long computation in them, nor "
            "in a loop around spin_once().",
        )
    if median_s < 2.0 * wanted_s and verdict.regular:
        no_timer = declarations.traced(recording) and not declarations.said(recording, "timer")
        beginning = "the process declared no timer: " if no_timer else ""
        return Explanation(
            f"{beginning}it looks like {wanted} of sleeping plus {longer} of work",
            f"Use a timer: self.create_timer({wanted_s:g}, self.callback) keeps its period "
            "whatever the callback needs.",
        )
    return Explanation(f"{found} instead of {wanted}", _seconds_hint(limits))


def _skipped(
    recording: Recording, declared: list[float], verdict: PeriodVerdict, limits: PeriodLimits
) -> Explanation | None:
    """One timer that is fast enough, and a callback that publishes in some of its calls only."""
    if len(declared) != 1 or not verdict.regular or declared[0] <= 0.0:
        return None
    calls = round(verdict.median_s / declared[0])
    if calls < 2 or not math.isclose(verdict.median_s, calls * declared[0], rel_tol=_SAME / 2):
        return None
    faster = declared[0] < limits.period_s * (1.0 - _SAME)
    if not faster and not _comes_round(recording, limits):
        return None
    hint = f"Publish in every call of a timer of {format_duration(limits.period_s)}."
    if faster:
        hint += (
            " A callback that compares times itself publishes only with the next call after its "
            "time has come."
        )
    return Explanation(
        f"the process declared a timer of {format_duration(declared[0])}, and only every "
        f"{_ORDINALS.get(calls, f'{calls}th')} call of it published",
        hint,
    )


def _comes_round(recording: Recording, limits: PeriodLimits) -> bool:
    """Whether the executor answers so soon that no callback keeps a timer waiting."""
    waited = long_wait(recording, {node.name for node in recording.student_nodes})
    return waited is not None and waited[1] < _AT_ONCE * limits.period_s


def _too_fast(recording: Recording, topic: str, limits: PeriodLimits) -> Explanation:
    if declarations.timer_of_zero(recording):
        return Explanation(
            "messages come too often: the process declared a timer of 0 s, which fires again and "
            "again without a pause",
            "Less than a second becomes 0 in whole numbers, as in 300 // 1000 or int(0.3). "
            f"{_seconds_hint(limits)}",
        )
    if recording.student_endpoints(Kind.SUBSCRIPTION, topic):
        return Explanation(
            "the node subscribes to the topic that it publishes on, so it may answer itself",
            "Do not publish in the callback of a subscription to the same topic.",
        )
    return Explanation("messages come too often", _ONE_TIMER)


def _irregular(
    measured: tuple[Interval, ...], verdict: PeriodVerdict, declared: list[float]
) -> Explanation:
    ratios = [
        measured[index].seconds / verdict.median_s if verdict.median_s else 0.0
        for index in verdict.irregular
    ]
    at_the_start = tuple(verdict.irregular) == tuple(range(len(ratios)))
    if at_the_start and all(ratio < _AT_ONCE for ratio in ratios):
        return Explanation(
            f"{len(ratios) + 1} messages come at once at the start",
            "Publish in the callback of the timer only, not in the constructor or in main() as "
            "well.",
        )
    if all(ratio > 1.5 and abs(ratio - round(ratio)) < 0.1 for ratio in ratios):
        return Explanation(
            "messages are left out",
            "Publish in every call of the callback, without a condition, and let no callback work "
            "or sleep for longer than the period: the timer cannot call meanwhile.",
        )
    if declared:
        return Explanation(
            "",
            "Publish in the timer's callback only, in every call, and let no callback work or "
            "sleep for long: the timer cannot call meanwhile.",
        )
    return Explanation(
        "",
        "Let a timer call the callback: self.create_timer(...) keeps its period, while sleeping "
        "and waiting in a loop do not.",
    )


def _seconds_hint(limits: PeriodLimits) -> str:
    return (
        f"create_timer takes its period in seconds: {format_duration(limits.period_s)} is "
        f"{limits.period_s:g}."
    )
