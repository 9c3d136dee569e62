"""Checks of when messages were published: their period and their rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Recorded
from grader.checks.timing.source_stamps import why_not_believed
from grader.checks.tolerance import TimeTolerance, Tolerance
from grader.diagnosis.explanation import cause_of, mistaken
from grader.diagnosis.no_messages import why_few
from grader.diagnosis.process.not_called import left_s
from grader.diagnosis.wrong_rhythm import WrongRhythm, why_paused
from grader.findings.finding import Evidence, Finding, Plot, evidence_at, first_seen
from grader.findings.words import code, counted
from grader.measure import declarations
from grader.measure.numbering import is_numbered, lost
from grader.measure.period import (
    MOST_INTERVALS,
    Interval,
    PeriodLimits,
    PeriodVerdict,
    forgiven,
    intervals,
    judge,
    undisturbed,
)
from grader.recording.model import NS, Message, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration, Frequency, Ratio
from grader.spec.unit import format_duration

_MS = 1e3
# A declared period is the one that was seen.
_SAME = 0.05
# One message may be late or left out; after so many periods they have stopped.
_ENDED_PERIODS = 3.0


class Period(Parameters):
    """Parameters of timing.period."""

    of_bags = True
    about = ("timer", "publisher")
    needs = (Recorded(),)

    topic: TopicName = Field(description="Fully qualified topic name.")
    period: Duration = Field(description="Expected time between two messages.")
    tolerance: Tolerance = Field(
        TimeTolerance(0.05, relative=True),
        description="How far the median of the intervals may be from the period: a share of it "
        "or a time.",
    )
    spread: Tolerance = Field(
        TimeTolerance(0.10, relative=True),
        description="How far a single interval may be from the median before it counts as "
        "irregular: a share of the period or a time.",
    )
    outliers: Ratio = Field(
        0.10,
        description="Share of the intervals that may be irregular, rounded down. At least one may "
        "be, unless the share is 0 %.",
    )
    at_least: int = Field(5, ge=1, description="Least number of intervals needed to judge.")

    def _asked(self) -> str:
        return (
            f"a message on {code(self.topic)} every {format_duration(self.period)} "
            f"(median within {self.tolerance}, intervals within {self.spread})"
        )

    @property
    def limits(self) -> PeriodLimits:
        """The same in seconds."""
        median_s, spread_s = self.tolerance.of(self.period), self.spread.of(self.period)
        return PeriodLimits(self.period, median_s, spread_s, self.outliers)


@check("timing.period", Subject.RECORDING, Period, concept="timers")
def period(recording: Recording, parameters: Period) -> Finding:
    """Messages come at the expected period.

    Judged by source timestamps, which the publisher's process sets in `publish()`, so a slow grader
    or network does not matter. The median of the intervals must be the period within `tolerance`;
    an interval that differs from the median by more than `spread` is irregular, and only few may be
    (`outliers`). One late message makes an interval too long and the next one too short: that
    counts once. A pause counts once for every missing message. Messages must go on until the end of
    the observation. Delays by the machine are measured and cost no points.
    """
    limits = parameters.limits
    messages = recording.on(parameters.topic)[: MOST_INTERVALS + 1]
    if len(messages) <= parameters.at_least and not _too_slow(messages, limits):
        return why_few(recording, parameters.topic, parameters.at_least + 1)
    stop_if(why_not_believed(recording, messages))
    measured = intervals(messages)
    if len(measured) < min(parameters.at_least, len(messages) - 1):
        return Finding.undecided(
            f"of {counted(len(messages), 'message')} so many neighbours were lost on their way to "
            f"the probe that only {counted(len(measured), 'interval')} can be judged"
        )
    verdict = judge([item.seconds for item in measured], limits)
    observed = _figures(measured, verdict)
    if not verdict.good:
        if not _machine_explains(recording, measured, verdict, limits):
            return _wrong_period(recording, parameters, measured, verdict)
        calm = undisturbed(recording, measured)
        if len(calm) < max(parameters.at_least, len(measured) / 2) or not judge(calm, limits).good:
            stolen_s = recording.stolen_s(measured[0].begin_ns, measured[-1].end_ns)
            return Finding.held_up(observed, stolen_s)
        observed += f"; the machine took time in {len(measured) - len(calm)}, which do not count"
    stop_if(_why_ended(recording, messages, parameters.period))
    return Finding.as_asked(observed, _evidence(recording, parameters, measured, verdict))


def _machine_explains(
    recording: Recording, measured: Sequence[Interval], verdict: PeriodVerdict, limits: PeriodLimits
) -> bool:
    """Whether the intervals would be right if the machine had taken no time."""
    if not verdict.period_good and _is_declared(recording, verdict, limits):
        return False
    return judge(forgiven(recording, measured, limits), limits).good


def _why_ended(
    recording: Recording, messages: Sequence[Message], period_s: float
) -> Finding | None:
    """Why no message came at the end of the observation; None if messages went on."""
    last_ns = messages[-1].stamp_ns
    # Of a flood only the beginning is looked at.
    is_flood = len(messages) > MOST_INTERVALS
    return why_paused(
        recording,
        (last_ns, recording.stop_ns),
        math.inf if is_flood else _ENDED_PERIODS * period_s,
        f"{counted(len(messages), 'message')} at the right period, but none in the last "
        f"{format_duration((recording.stop_ns - last_ns) / NS)} of the observation",
        "ended",
    )


def _wrong_period(
    recording: Recording, parameters: Period, measured: tuple[Interval, ...], verdict: PeriodVerdict
) -> Finding:
    limits = parameters.limits
    observed = _figures(measured, verdict)
    if verdict.period_good:
        number = len(verdict.irregular)
        observed += (
            f"; {counted(number, 'interval')} of {len(measured)} "
            f"{'differs' if number == 1 else 'differ'} from the median by more than "
            f"{format_duration(limits.spread_s)}"
        )
    cause = cause_of(WrongRhythm(recording, parameters.topic, measured, verdict, limits))
    if cause.observed:
        observed += f": {cause.observed}"
    shown = _evidence(recording, parameters, measured, verdict)
    shown = replace(shown, places=cause.evidence.places)
    return replace(cause, observed=observed, evidence=shown)


def _is_declared(recording: Recording, verdict: PeriodVerdict, limits: PeriodLimits) -> bool:
    """Whether the process declared a wrong period that is the median, and no right one.

    What holds up a process moves single messages of a timer, never its period.
    """
    declared = [timer.period_s for timer in declarations.timers(recording)]
    right = any(judge([item], limits).period_good for item in declared)
    return not right and any(
        math.isclose(item, verdict.median_s, rel_tol=_SAME) for item in declared
    )


def _too_slow(messages: tuple[Message, ...], limits: PeriodLimits) -> bool:
    """Whether there are few messages because their period is too long."""
    seconds = [item.seconds for item in intervals(messages)]
    verdict = judge(seconds, limits) if seconds else None
    return verdict is not None and not verdict.period_good and verdict.median_s > limits.period_s


def _figures(measured: tuple[Interval, ...], verdict: PeriodVerdict) -> str:
    worst_s = max(abs(item.seconds - verdict.median_s) for item in measured)
    return (
        f"median {format_duration(verdict.median_s)}, largest deviation from it "
        f"{format_duration(worst_s)}, over {counted(len(measured), 'interval')}"
    )


def _evidence(
    recording: Recording, parameters: Period, measured: tuple[Interval, ...], verdict: PeriodVerdict
) -> Evidence:
    limits = parameters.limits
    # Shown is the band that decided: that of the median, or that of the single intervals.
    if verdict.period_good:
        middle_s, within_s = verdict.median_s, limits.spread_s
    else:
        middle_s, within_s = limits.period_s, limits.median_s
    worst = max(measured, key=lambda item: abs(item.seconds - limits.period_s))
    label = f"worst interval: {format_duration(worst.seconds)}"
    return evidence_at(
        recording,
        label,
        worst.end_ns,
        Plot(
            title=f"Time between messages on {parameters.topic}",
            x_label="time since launch (s)",
            y_label="time between messages (ms)",
            x=tuple(recording.since_launch_s(item.end_ns) for item in measured),
            y=tuple(item.seconds * _MS for item in measured),
            band=((middle_s - within_s) * _MS, (middle_s + within_s) * _MS),
            histogram=True,
        ),
    )


class Rate(Parameters):
    """Parameters of timing.rate."""

    of_bags = True
    about = ("timer", "publisher")
    needs = (Recorded(),)

    topic: TopicName = Field(description="Fully qualified topic name.")
    at_least: Frequency | None = Field(None, description="Lowest rate.")
    at_most: Frequency | None = Field(None, description="Highest rate.")
    messages: int = Field(5, ge=2, description="Least number of messages needed to judge.")
    pause: Duration | None = Field(
        None,
        description="Longest time without a message after the first one, until the end of the "
        "observation; by default any.",
    )

    @model_validator(mode="after")
    def _sensible(self) -> Rate:
        if self.at_least is None and self.at_most is None:
            raise ValueError("give a bound: at_least, at_most or both")
        if self.at_least and self.at_most and self.at_least > self.at_most:
            raise ValueError("at_least is more than at_most")
        return self

    def _asked(self) -> str:
        bounds = {"at least": self.at_least, "at most": self.at_most}
        texts = [f"{name} {hz:g} Hz" for name, hz in bounds.items() if hz is not None]
        words = f"{' and '.join(texts)} on {code(self.topic)}"
        if self.pause is not None:
            words += f", never longer than {format_duration(self.pause)} without one"
        return words


@check("timing.rate", Subject.RECORDING, Rate, concept="timers")
def rate(recording: Recording, parameters: Rate) -> Finding:
    """Messages come at a rate within bounds.

    The rate is the number of messages after the first, divided by the time from the first to the
    last, by source timestamps. `ros2 topic hz` shows the same. Regularity does not matter (see
    timing.period), except that `pause` limits the pauses. Messages that were sent but lost in
    transit count. Delays by the machine are measured and cost no points.
    """
    messages = recording.on(parameters.topic)
    if len(messages) < parameters.messages:
        return why_few(recording, parameters.topic, parameters.messages)
    stop_if(why_not_believed(recording, messages))
    first, last = messages[0], messages[-1]
    span_s = (last.stamp_ns - first.stamp_ns) / NS
    # Messages after the first, with those that were lost on their way.
    number = last.sequence - first.sequence if is_numbered(messages) else len(messages) - 1
    rate_hz = number / span_s if span_s > 0.0 else math.inf
    observed = f"{rate_hz:.4g} Hz: {counted(number + 1, 'message')} in {format_duration(span_s)}"
    evidence = Evidence(moments=first_seen(recording, messages))
    if parameters.at_least is not None and rate_hz < parameters.at_least:
        own_s = left_s(recording, first.stamp_ns, last.stamp_ns)
        if number >= parameters.at_least * own_s:
            return Finding.undecided(f"{observed}, but the machine took time from the process")
        return mistaken("other_rate", observed, evidence)
    if parameters.at_most is not None and rate_hz > parameters.at_most:
        return mistaken("other_rate", observed, evidence)
    stop_if(_why_paused(recording, parameters, messages))
    return Finding.as_asked(observed, evidence)


def _why_paused(
    recording: Recording, parameters: Rate, messages: tuple[Message, ...]
) -> Finding | None:
    """Why the longest time without a message is too long, or None."""
    if parameters.pause is None:
        return None
    last_ns = messages[-1].stamp_ns
    stop_ns = max(recording.stop_ns, last_ns)
    # Where numbers are missing, messages came that were lost.
    gaps = [(a.stamp_ns, b.stamp_ns) for a, b in pairwise(messages) if not lost(a, b)]
    begin_ns, end_ns = max([*gaps, (last_ns, stop_ns)], key=lambda gap: gap[1] - gap[0])
    until = " until the end" if end_ns == stop_ns else ""
    before = sum(message.stamp_ns <= begin_ns for message in messages)
    return why_paused(
        recording,
        (begin_ns, end_ns),
        parameters.pause,
        f"no message for {format_duration((end_ns - begin_ns) / NS)}{until}, from "
        f"{recording.since_launch_s(begin_ns):.2f} s after launch on, after "
        f"{counted(before, 'message')}",
        "silent_calls",
    )
