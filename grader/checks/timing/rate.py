"""How many messages come in a second."""

from __future__ import annotations

import math
from itertools import pairwise

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment
from grader.checks.need import Recorded
from grader.checks.timing.stamps import why_not_believed
from grader.checks.wording import code, counted
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_messages import why_few
from grader.diagnosis.process.blocked_executor import left_s
from grader.diagnosis.wrong_rhythm import why_paused
from grader.measure.numbering import is_numbered, lost
from grader.recording.model import NS, Message, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration, Frequency
from grader.spec.unit import format_duration


class Rate(Parameters):
    """Parameters of timing.rate."""

    needs = (Recorded(),)

    topic: TopicName = Field(description="Fully qualified topic name.")
    at_least: Frequency | None = Field(None, description="Lowest rate.")
    at_most: Frequency | None = Field(None, description="Highest rate.")
    messages: int = Field(5, ge=2, description="Messages that are needed to judge.")
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

    @property
    def words(self) -> str:
        """The bounds, in words."""
        bounds = {"at least": self.at_least, "at most": self.at_most}
        texts = [f"{name} {hz:g} Hz" for name, hz in bounds.items() if hz is not None]
        words = f"{' and '.join(texts)} on {code(self.topic)}"
        if self.pause is not None:
            words += f", never longer than {format_duration(self.pause)} without one"
        return words


@check("timing.rate", Subject.RECORDING, Rate)
def rate(recording: Recording, parameters: Rate) -> Finding:
    """Messages come at a rate within bounds.

    The rate is the number of messages after the first, divided by the time from the first to the
    last by source timestamps, as `ros2 topic hz` tells it; how regularly they come does not
    matter (see timing.period), unless `pause` says how long a pause may be. Messages that the
    writer numbered but that were lost on their way count. What the machine took from the process
    is measured, and never costs a point.
    """
    expected = parameters.words
    messages = recording.on(parameters.topic)
    if len(messages) < parameters.messages:
        return why_few(recording, parameters.topic, parameters.messages).finding(expected)
    unbelievable = why_not_believed(recording, messages)
    if unbelievable is not None:
        return unbelievable.finding(expected)
    first, last = messages[0], messages[-1]
    span_s = (last.stamp_ns - first.stamp_ns) / NS
    # Messages after the first, with those that were lost on their way.
    number = last.sequence - first.sequence if is_numbered(messages) else len(messages) - 1
    found_hz = number / span_s if span_s > 0.0 else math.inf
    observed = f"{found_hz:.4g} Hz: {counted(number + 1, 'message')} in {format_duration(span_s)}"
    evidence = Evidence(
        moments=(
            Moment("first message", recording.since_launch_s(first.stamp_ns)),
            Moment("last message", recording.since_launch_s(last.stamp_ns)),
        )
    )
    is_slow = parameters.at_least is not None and found_hz < parameters.at_least
    if is_slow and number >= (parameters.at_least or 0.0) * left_s(
        recording, first.stamp_ns, last.stamp_ns
    ):
        return Finding.to_repeat(
            expected, f"{observed}, but the machine took time from the process"
        )
    if is_slow or (parameters.at_most is not None and found_hz > parameters.at_most):
        return Finding.failed(
            expected,
            observed,
            "Publish once in every call of the callback: look for a condition that leaves calls "
            "out, for a time.sleep(), and for a second timer or publish(). create_timer takes its "
            "period in seconds: the reciprocal of the rate.",
            evidence,
        )
    paused = _why_paused(recording, parameters, messages)
    return paused.finding(expected) if paused else Finding.passed(expected, observed, evidence)


def _why_paused(
    recording: Recording, parameters: Rate, messages: tuple[Message, ...]
) -> Cause | None:
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
        "Look for an `if` or a `return` before publish(msg), for an `except: pass` that hides an "
        "error, for a timer that is cancelled, and for a callback that does not return.",
    )
