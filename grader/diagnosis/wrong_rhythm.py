"""Why messages come at another period than expected, irregularly, or with a long pause."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from statistics import mean

from grader.diagnosis.explanation import Symptom, explanation, mistaken
from grader.diagnosis.no_messages import seconds_hint
from grader.diagnosis.process.not_called import left_s
from grader.diagnosis.process.process_exit import why_ended
from grader.diagnosis.process.standing import slow_callback
from grader.findings.finding import Evidence, Finding, evidence_at
from grader.findings.words import counted, listing
from grader.measure import declarations
from grader.measure.period import Interval, PeriodLimits, PeriodVerdict
from grader.recording.model import NS, Kind, Recording
from grader.spec.unit import format_duration

# How far a declared period may be off a measured one, as a share of that.
_SAME = 0.05
# Share of the period from which on a call of a callback is what makes the next one late.
_LONG = 0.5
# How far intervals may be off a multiple of a timer's period, as a share of that.
_OFF = 0.2
# A period in another unit is off by a power of 10.
_POWERS = (1e-6, 1e-3, 0.01, 0.1, 10.0, 100.0, 1e3, 1e6)
# So many publishers or timers for one topic are a mistake; more of them are something else.
_TIMES = range(2, 6)
# How far the average may be off a whole number of messages in each period, as a share of that.
_TIMES_TOLERANCE = 0.08


@dataclass(frozen=True)
class WrongRhythm(Symptom[Finding], concept="timers"):
    """Messages come at the wrong period, or irregularly.

    What a cause observes is a clause that follows the figures, or nothing.

    Attributes:
        measured: At least one interval.
    """

    recording: Recording
    topic: str
    measured: tuple[Interval, ...]
    verdict: PeriodVerdict
    limits: PeriodLimits

    @cached_property
    def timers_s(self) -> list[float]:
        """Periods of the timers that the process declared, in seconds."""
        return [timer.period_s for timer in declarations.timers(self.recording)]

    def declares(self, period_s: float) -> list[float]:
        """The declared periods that are nearly this one."""
        return [item for item in self.timers_s if math.isclose(item, period_s, rel_tol=_SAME)]


@explanation(WrongRhythm)
def several_in_each_period(symptom: WrongRhythm) -> Finding | None:
    """Two to five messages come in each period: two publishers, two timers or two publish()."""
    average_s = mean(item.seconds for item in symptom.measured)
    if average_s <= 0.0:
        return None
    ratio = symptom.limits.period_s / average_s
    times = round(ratio)
    allowed = _TIMES_TOLERANCE * times
    if not symptom.verdict.regular:
        # A burst that the observation cut in two leaves the average off by some messages.
        allowed += times * (times - 1) / len(symptom.measured)
    if times not in _TIMES or abs(ratio - times) > allowed:
        return None
    words = f"messages come {times} times as often as expected"
    publishers = symptom.recording.student_endpoints(Kind.PUBLISHER, symptom.topic)
    if len(publishers) > 1:
        return mistaken("one_timer", f"{words}, from {len(publishers)} publishers on the topic")
    if len(symptom.timers_s) == 1 and symptom.declares(average_s):
        words += f": the process declared a timer of {format_duration(symptom.timers_s[0])}"
        return Finding(words, seconds_hint(symptom.limits.period_s))
    if len(symptom.timers_s) > 1:
        words += f", and the process declared {len(symptom.timers_s)} timers"
    return mistaken("one_timer", words)


@explanation(WrongRhythm, concept="executors")
def slow_call(symptom: WrongRhythm) -> Finding | None:
    """A callback sleeps or works for long, so the timer has to wait for it."""
    stand, period_s = slow_callback(symptom.recording), symptom.limits.period_s
    is_late = symptom.verdict.median_s > period_s or not symptom.verdict.regular
    if stand is None or not is_late or (stand.lasted_s or 0.0) < _LONG * period_s:
        return None
    return Finding(stand.words, stand.hint, Evidence(places=(stand.place,)))


@explanation(WrongRhythm)
def condition_in_a_faster_timer(symptom: WrongRhythm) -> Finding | None:
    """A timer is faster, and a condition in its callback lets only every n-th call publish."""
    wanted_s = symptom.limits.period_s
    for timer_s in symptom.timers_s:
        intervals_s = [interval.seconds for interval in symptom.measured]
        calls = [round(interval_s / timer_s) for interval_s in intervals_s]
        pairs = zip(intervals_s, calls, strict=True)
        off_s = max(abs(interval_s - number * timer_s) for interval_s, number in pairs)
        if 2.0 * timer_s <= wanted_s and min(calls) > 1 and off_s <= _OFF * timer_s:
            numbers = listing(map(str, sorted(set(calls))), "or")
            return mistaken(
                "condition_in_a_faster_timer",
                f"the process declared a timer of {format_duration(timer_s)}, and publishes in "
                f"one of {numbers} calls",
                seconds=f"{wanted_s:g}",
            )
    return None


@explanation(WrongRhythm)
def irregular(symptom: WrongRhythm) -> Finding | None:
    """The period is right, but not all intervals: a callback takes long, a condition, a loop."""
    if not symptom.verdict.period_good:
        return None
    return mistaken("irregular" if symptom.timers_s else "irregular_without_timer", "")


@explanation(WrongRhythm)
def other_timer(symptom: WrongRhythm) -> Finding | None:
    """The timer has another period, such as 10 times the expected one, or 0 from int(0.3)."""
    median_s, wanted_s = symptom.verdict.median_s, symptom.limits.period_s
    clauses = [
        f"{power:g} times the expected period"
        for power in _POWERS
        if math.isclose(median_s / wanted_s, power, rel_tol=0.1)
    ]
    timers_s = symptom.declares(median_s)
    if median_s <= wanted_s and declarations.timer_of_zero(symptom.recording):
        timers_s = [0.0]
    if timers_s:
        clauses.append(f"the process declared a timer of {format_duration(timers_s[0])}")
    return Finding("; ".join(clauses), seconds_hint(wanted_s)) if clauses else None


@explanation(WrongRhythm)
def right_timer_too_late(symptom: WrongRhythm) -> Finding | None:
    """The timer is right, but is created again or reset, or the executor does not call it."""
    wanted_s, late_s = symptom.limits.period_s, symptom.verdict.median_s - symptom.limits.period_s
    right = symptom.declares(wanted_s)
    if not right or late_s < 0.0:
        return None
    return mistaken(
        "right_timer_too_late",
        f"{format_duration(late_s)} too long, although the process declared "
        f"{counted(len(right), 'timer')} of {format_duration(wanted_s)}",
    )


@explanation(WrongRhythm)
def sleeping_loop(symptom: WrongRhythm) -> Finding | None:
    """A loop sleeps for the period, and its work takes additional time."""
    wanted_s, median_s = symptom.limits.period_s, symptom.verdict.median_s
    longer = wanted_s < median_s < 2.0 * wanted_s
    if not longer or not symptom.verdict.regular or symptom.timers_s:
        return None
    recording = symptom.recording
    no_timer = declarations.traced(recording) and not declarations.declares(recording, "timer")
    beginning = "the process declared no timer: " if no_timer else ""
    return mistaken(
        "sleeping_loop",
        f"{beginning}it looks like {format_duration(wanted_s)} of sleeping plus "
        f"{format_duration(median_s - wanted_s)} of work",
        seconds=f"{wanted_s:g}",
    )


@explanation(WrongRhythm, general=True)
def other_period(symptom: WrongRhythm) -> Finding:
    """Messages come too often or too rarely."""
    if symptom.verdict.median_s < symptom.limits.period_s:
        return mistaken("one_timer", "messages come too often")
    return Finding(
        f"{format_duration(symptom.verdict.median_s)} instead of "
        f"{format_duration(symptom.limits.period_s)}",
        seconds_hint(symptom.limits.period_s),
    )


def why_paused(
    recording: Recording, pause_ns: tuple[int, int], allowed_s: float, seen: str, mistake: str
) -> Finding | None:
    """Why nothing came for longer than allowed, or None where the pause is short enough.

    Args:
        pause_ns: When it began and ended.
        seen: What was seen, with how long it was.
        mistake: Where the program runs on, and the machine has no part in it.
    """
    begin_ns, end_ns = pause_ns
    if (end_ns - begin_ns) / NS <= allowed_s:
        return None
    ended = why_ended(recording, seen) if end_ns >= recording.stop_ns else None
    if ended is not None:
        return ended
    if left_s(recording, begin_ns, end_ns) <= allowed_s:
        return Finding.undecided(f"{seen}, but the machine took the time from the process")
    return mistaken(mistake, seen, evidence_at(recording, "nothing from here on", begin_ns))
