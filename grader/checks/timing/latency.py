"""How soon a node answers what it is sent."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment, Plot
from grader.checks.need import Published, Recorded
from grader.checks.wording import code, counted
from grader.diagnosis.delivery import why_not_sent
from grader.diagnosis.destroyed_endpoint import why_unsubscribed
from grader.diagnosis.no_messages import why_silent
from grader.recording.model import NS, Message, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

_MS = 1e3


@dataclass(frozen=True)
class Reaction:
    """A message that the probe sent, and what came of it.

    Attributes:
        answer: The first message that may answer it, or None.
    """

    sent: Message
    answer: Message | None

    @property
    def seconds(self) -> float | None:
        """From sending to the source timestamp of the answer; None without an answer."""
        if self.answer is None:
            return None
        return (self.answer.stamp_ns - self.sent.stamp_ns) / NS


def reactions(
    sent: Sequence[Message], answers: Sequence[Message], within_ns: int
) -> tuple[Reaction, ...]:
    """Pair what was sent with the answers, in the order of both.

    An answer belongs to one message: the oldest that is still unanswered when it comes. A
    message whose time has passed when the next answer comes was not answered.
    """
    stamps = [message.stamp_ns for message in answers]
    found = []
    free = 0
    for message in sent:
        first = max(free, bisect_left(stamps, message.stamp_ns))
        if first < len(stamps) and stamps[first] <= message.stamp_ns + within_ns:
            found.append(Reaction(message, answers[first]))
            free = first + 1
        else:
            found.append(Reaction(message, None))
    return tuple(found)


class Latency(Parameters):
    """Parameters of timing.latency."""

    needs = (Recorded(), Published())

    stimulus: TopicName = Field(description="Topic that a stimulus publishes on.")
    topic: TopicName = Field(description="Topic that the node answers on.")
    median: Duration | None = Field(None, description="Longest median of the latencies.")
    most: Duration | None = Field(None, description="Longest single latency.")
    within: Duration = Field(
        1.0,
        description="What comes later than this is no answer any more.",
        validate_default=False,
    )
    unanswered: int = Field(0, ge=0, description="How many messages may have no answer.")

    @model_validator(mode="after")
    def _something(self) -> Latency:
        if self.median is None and self.most is None:
            raise ValueError("say how long it may take: median, most or both")
        for name in ("median", "most"):
            limit = getattr(self, name)
            if limit is not None and limit > self.within:
                raise ValueError(f"'{name}' is more than 'within': raise 'within'")
        return self


@check("timing.latency", Subject.RECORDING, Latency)
def latency(recording: Recording, parameters: Latency) -> Finding:
    """The node answers soon.

    The latency is the time from the probe's publishing of a message to the source timestamp of
    the node's answer. Answers are taken in their order, one for each message. What the machine
    took from the process meanwhile is measured, and never costs a point.
    """
    limits = [
        f"{words} {format_duration(limit)}"
        for words, limit in (("median", parameters.median), ("each", parameters.most))
        if limit is not None
    ]
    expected = (
        f"an answer on {code(parameters.topic)} to each message on {code(parameters.stimulus)}: "
        f"{', '.join(limits)} at most"
    )
    sent = recording.sent.get(parameters.stimulus, ())
    answers = recording.on(parameters.topic)
    if not answers:
        return why_silent(recording, parameters.topic).finding(expected)
    if not sent:
        return why_not_sent(recording, parameters.stimulus).finding(expected)
    found = reactions(sent, answers, round(parameters.within * NS))
    times = [item.seconds for item in found if item.seconds is not None]
    missing = [item for item in found if item.answer is None]
    wrong = _too_slow(times, parameters)
    if not wrong and len(missing) <= parameters.unanswered:
        return Finding.passed(expected, _figures(times), _evidence(recording, found, parameters))
    observed = (
        f"{len(missing)} of {counted(len(found), 'message')} on {code(parameters.stimulus)} "
        f"had no answer within {format_duration(parameters.within)}"
    )
    if len(missing) > parameters.unanswered:
        last_ns = missing[-1 - parameters.unanswered].sent.stamp_ns
        destroyed = why_unsubscribed(recording, parameters.stimulus, observed, last_ns)
        if destroyed is not None:
            return destroyed.finding(expected)
    forgiven = [
        max(0.0, item.seconds - _stolen_s(recording, item))
        for item in found
        if item.seconds is not None
    ]
    excusable = [item for item in missing if _stolen_s(recording, item, parameters.within) > 0.0]
    if not _too_slow(forgiven, parameters) and (
        len(missing) - len(excusable) <= parameters.unanswered
    ):
        stolen_s = recording.stolen_s(sent[0].stamp_ns, recording.stop_ns)
        return Finding.to_repeat(
            expected,
            f"{_figures(times)}; the machine took up to {format_duration(stolen_s)} from the "
            "process meanwhile, which may explain it",
        )
    evidence = _evidence(recording, found, parameters)
    if len(missing) > parameters.unanswered:
        return Finding.failed(
            expected,
            observed + (f"; of the others {_figures(times)}" if times else ""),
            "Publish one answer in every call of the subscription's callback, with no condition "
            "that leaves one out.",
            evidence,
        )
    words, hint = _explanation(found)
    return Finding.failed(expected, f"{_figures(times)}{words}", hint, evidence)


def _too_slow(times: Sequence[float], parameters: Latency) -> bool:
    if not times:
        return False
    over_median = parameters.median is not None and median(times) > parameters.median
    return over_median or (parameters.most is not None and max(times) > parameters.most)


def _stolen_s(recording: Recording, item: Reaction, within_s: float = 0.0) -> float:
    end_ns = item.answer.stamp_ns if item.answer else item.sent.stamp_ns + round(within_s * NS)
    return recording.stolen_s(item.sent.stamp_ns, end_ns)


def _figures(times: Sequence[float]) -> str:
    if not times:
        return "no answers"
    return (
        f"median {format_duration(median(times))}, largest {format_duration(max(times))}, over "
        f"{counted(len(times), 'answer')}"
    )


def _explanation(found: Sequence[Reaction]) -> tuple[str, str]:
    times = [item.seconds for item in found if item.seconds is not None]
    third = len(times) // 3
    if third and min(times[-third:]) > 2.0 * max(times[:third]):
        return (
            ": the answers come later and later, so the callback takes longer than the time "
            "between two messages",
            "Do less in the callback: no sleep, no wait, no loop over what is there already.",
        )
    return (
        "",
        "Publish the answer in the subscription's callback itself: not from a timer, and not "
        "after time.sleep().",
    )


def _evidence(recording: Recording, found: Sequence[Reaction], parameters: Latency) -> Evidence:
    answered = [(item, item.seconds) for item in found if item.seconds is not None]
    moments = tuple(
        Moment(
            f"sent on {parameters.stimulus}, not answered",
            recording.since_launch_s(item.sent.stamp_ns),
        )
        for item in found
        if item.answer is None
    )[:10]
    if not answered:
        return Evidence(moments=moments)
    worst, seconds = max(answered, key=lambda pair: pair[1])
    limit = parameters.most or parameters.median or 0.0
    return Evidence(
        moments=(
            *moments,
            Moment(
                f"slowest answer: after {format_duration(seconds)}",
                recording.since_launch_s(worst.sent.stamp_ns),
            ),
        ),
        plots=(
            Plot(
                title=f"From a message on {parameters.stimulus} to its answer",
                x_label="time since launch (s)",
                y_label="latency (ms)",
                x=tuple(recording.since_launch_s(item.sent.stamp_ns) for item, _ in answered),
                y=tuple(value * _MS for _, value in answered),
                band=(0.0, limit * _MS),
            ),
        ),
    )
