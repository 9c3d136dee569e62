"""Why messages come at another period than expected, irregularly, or with a long pause."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from statistics import mean

from grader.diagnosis.cause import Cause
from grader.diagnosis.explanation import Symptom, explanation
from grader.diagnosis.no_messages import seconds_hint
from grader.diagnosis.process.blocked_executor import left_s, long_wait
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.finding import Evidence, Moment
from grader.measure import declarations
from grader.measure.period import Interval, PeriodLimits, PeriodVerdict
from grader.recording.model import NS, Kind, Recording
from grader.spec.unit import format_duration

_SAME = 0.05
_POWERS = (10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
_TIMES = {2: "twice", 3: "three times", 4: "four times", 5: "five times"}
_TIMES_TOLERANCE = 0.08
# So many timers of one period are created in a callback.
_CREATED_AGAIN = 4
# An executor that answers within this share of the period lets no timer wait.
_AT_ONCE = 0.1


_ONE_TIMER = "Create one timer in the constructor, once, and publish once in its callback."


@dataclass(frozen=True)
class WrongRhythm(Symptom[Cause], concept="timers"):
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

    @property
    def seconds_hint(self) -> str:
        """The period as an argument of create_timer."""
        wanted_s = self.limits.period_s
        example = f"{format_duration(wanted_s)} is {wanted_s:g}"
        return seconds_hint(self.recording, self.topic, example, wanted_s)

    def declares(self, period_s: float) -> list[float]:
        """The declared periods that are nearly this one."""
        return [item for item in self.timers_s if math.isclose(item, period_s, rel_tol=_SAME)]


@explanation(WrongRhythm)
def several_in_each_period(symptom: WrongRhythm) -> Cause | None:
    """Two to five messages come in each period: two publishers, two timers or two publish()."""
    average_s = mean(item.seconds for item in symptom.measured)
    if average_s <= 0.0:
        return None
    ratio = symptom.limits.period_s / average_s
    times = round(ratio)
    # A burst that the observation cut in two leaves the average off by some messages.
    cut = 0.0 if symptom.verdict.regular else times * (times - 1) / len(symptom.measured)
    if times not in _TIMES or abs(ratio - times) > _TIMES_TOLERANCE * times + cut:
        return None
    words = f"messages come {_TIMES[times]} as often as expected"
    publishers = symptom.recording.student_endpoints(Kind.PUBLISHER, symptom.topic)
    timers_s = symptom.timers_s
    if len(publishers) > 1:
        return Cause(
            f"{words}, from {len(publishers)} publishers on the topic",
            "Create one publisher and launch the node once.",
        )
    if len(timers_s) > 1:
        return Cause(f"{words}, and the process declared {len(timers_s)} timers", _ONE_TIMER)
    if symptom.declares(average_s):
        return Cause(
            f"{words}: the process declared a timer of {format_duration(timers_s[0])}",
            symptom.seconds_hint,
        )
    return Cause(words, _ONE_TIMER)


@explanation(WrongRhythm)
def some_left_out(symptom: WrongRhythm) -> Cause | None:
    """The period is right, but some messages are missing."""
    verdict = symptom.verdict
    if not verdict.period_good or verdict.median_s <= 0.0:
        return None
    ratios = [symptom.measured[index].seconds / verdict.median_s for index in verdict.irregular]
    if any(ratio < 1.5 or abs(ratio - round(ratio)) > 0.1 for ratio in ratios):
        return None
    return Cause(
        "messages are left out",
        "Publish in every call of the callback, without a condition. No callback may work or "
        "sleep for longer than the period: the timer has to wait for it.",
    )


@explanation(WrongRhythm)
def irregular(symptom: WrongRhythm) -> Cause | None:
    """The period is right, but many intervals are not: a callback takes long, or a loop sleeps."""
    if not symptom.verdict.period_good:
        return None
    if symptom.timers_s:
        hint = (
            "Publish in the timer's callback only, in every call. No callback may work or sleep "
            "for long: the timer has to wait for it."
        )
    else:
        hint = (
            "Let a timer call the callback: self.create_timer(...) keeps its period, while "
            "sleeping and waiting in a loop do not."
        )
    return Cause("", hint)


@explanation(WrongRhythm)
def other_timer(symptom: WrongRhythm) -> Cause | None:
    """The timer has another period, such as 1/10 or 10 times the expected one."""
    median_s = symptom.verdict.median_s
    ratio = median_s / symptom.limits.period_s
    words = []
    for power in _POWERS:
        if math.isclose(ratio, power, rel_tol=0.1):
            words.append(f"{power:g} times the expected period")
        elif math.isclose(ratio, 1.0 / power, rel_tol=0.1):
            words.append(f"1/{power:g} of the expected period")
    same = symptom.declares(median_s)
    words += [f"the process declared a timer of {format_duration(item)}" for item in same[:1]]
    return Cause("; ".join(words), symptom.seconds_hint) if words else None


@explanation(WrongRhythm)
def timer_of_zero(symptom: WrongRhythm) -> Cause | None:
    """A timer of 0 s fires again and again without a pause."""
    recording = symptom.recording
    too_often = symptom.verdict.median_s <= symptom.limits.period_s
    if not too_often or not declarations.timer_of_zero(recording):
        return None
    how = "300 // 1000 or int(0.3)"
    if declarations.is_compiled_publisher(recording, symptom.topic):
        how = "std::chrono::seconds(300 / 1000)"
    return Cause(
        "messages come too often: the process declared a timer of 0 s, which fires again and "
        "again without a pause",
        f"A period below 1 s becomes 0 as an integer, as in {how}. {symptom.seconds_hint}",
    )


@explanation(WrongRhythm)
def right_timer_too_late(symptom: WrongRhythm) -> Cause | None:
    """The timer is right, but is created again or reset, or the executor does not call it."""
    wanted_s, late_s = symptom.limits.period_s, symptom.verdict.median_s - symptom.limits.period_s
    right = symptom.declares(wanted_s)
    if not right or late_s < 0.0:
        return None
    wanted, longer = format_duration(wanted_s), f"{format_duration(late_s)} too long"
    if len(right) >= _CREATED_AGAIN:
        return Cause(
            f"{longer}: the process declared {len(right)} timers of {wanted}, as if the callback "
            "created a new one each time",
            "Create one timer in the constructor: it calls again by itself, and keeps its period "
            "however long the callback takes.",
        )
    waited = long_wait(symptom.recording, {node.name for node in symptom.recording.student_nodes})
    if symptom.verdict.regular and waited is not None and waited[1] < _AT_ONCE * wanted_s:
        return Cause(
            f"{longer}, although the executor is not blocked and the process declared a timer of "
            f"{wanted}",
            "Publish in every call of the timer's callback, and leave out timer.reset(), which "
            "restarts the period.",
        )
    return Cause(
        f"{longer}: the process declared a timer of {wanted}, but the executor does not call it "
        "in time",
        "Keep callbacks short: no sleep, no loop that waits, no long computation. Keep a loop "
        "around spin_once() short too.",
    )


@explanation(WrongRhythm)
def sleeping_loop(symptom: WrongRhythm) -> Cause | None:
    """A loop sleeps for the period, and its work takes additional time."""
    wanted_s, median_s = symptom.limits.period_s, symptom.verdict.median_s
    longer = wanted_s < median_s < 2.0 * wanted_s
    if not longer or not symptom.verdict.regular or symptom.timers_s:
        return None
    recording = symptom.recording
    no_timer = declarations.traced(recording) and not declarations.declares(recording, "timer")
    beginning = "the process declared no timer: " if no_timer else ""
    return Cause(
        f"{beginning}it looks like {format_duration(wanted_s)} of sleeping plus "
        f"{format_duration(median_s - wanted_s)} of work",
        f"Use a timer: self.create_timer({wanted_s:g}, self.callback) keeps its period however "
        "long the callback takes.",
    )


@explanation(WrongRhythm, general=True)
def other_period(symptom: WrongRhythm) -> Cause:
    """Messages come too often or too rarely."""
    if symptom.verdict.median_s < symptom.limits.period_s:
        return Cause("messages come too often", _ONE_TIMER)
    return Cause(
        f"{format_duration(symptom.verdict.median_s)} instead of "
        f"{format_duration(symptom.limits.period_s)}",
        symptom.seconds_hint,
    )


def why_paused(
    recording: Recording, pause_ns: tuple[int, int], allowed_s: float, seen: str, hint: str
) -> Cause | None:
    """Why nothing came for longer than allowed, or None where the pause is short enough.

    Args:
        pause_ns: When it began and ended.
        seen: What was seen, with how long it was.
        hint: What to try where the program runs on, and the machine has no part in it.
    """
    begin_ns, end_ns = pause_ns
    if (end_ns - begin_ns) / NS <= allowed_s:
        return None
    ended = why_ended(recording, seen) if end_ns >= recording.stop_ns else None
    if ended is not None:
        return ended
    if left_s(recording, begin_ns, end_ns) <= allowed_s:
        return Cause.to_repeat(f"{seen}, but the machine took the time from the process")
    moment = Moment("nothing from here on", recording.since_launch_s(begin_ns))
    return Cause(seen, hint, Evidence(moments=(moment,)))
