"""How soon a node answers what it is sent."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from itertools import zip_longest
from statistics import median

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import PUBLISHED, Recorded
from grader.diagnosis.destroyed_endpoint import why_unsubscribed
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_messages import why_not_sent, why_silent
from grader.diagnosis.process.not_called import left_s
from grader.findings.finding import Evidence, Finding, Plot, moment
from grader.findings.words import code, counted
from grader.recording.model import NS, Message, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

_MS = 1e3


def answers_to(
    sent: Sequence[Message], answers: Sequence[Message], within_ns: int
) -> list[Message | None]:
    """The answer to each message, or None, in the order of both.

    An answer belongs to one message: the oldest that is still unanswered when it comes. A
    message whose time has passed when the next answer comes was not answered.
    """
    stamps = [message.stamp_ns for message in answers]
    found: list[Message | None] = []
    free = 0
    for message in sent:
        first = max(free, bisect_left(stamps, message.stamp_ns))
        if first < len(stamps) and stamps[first] <= message.stamp_ns + within_ns:
            found.append(answers[first])
            free = first + 1
        else:
            found.append(None)
    return found


class Latency(Parameters):
    """Parameters of timing.latency."""

    needs = (Recorded(), PUBLISHED)

    stimulus: TopicName = Field(description="Topic that a stimulus publishes on.")
    topic: TopicName = Field(description="Topic that the node answers on.")
    median: Duration | None = Field(None, description="Longest median of the latencies.")
    most: Duration | None = Field(None, description="Longest single latency.")
    within: Duration = Field(
        1.0,
        description="An answer that comes later than this does not count.",
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

    def _asked(self) -> str:
        limits = {"median": self.median, "each": self.most}
        texts = [f"{name} {format_duration(most)}" for name, most in limits.items() if most]
        return (
            f"an answer on {code(self.topic)} to each message on {code(self.stimulus)}: "
            f"{', '.join(texts)} at most"
        )

    def is_too_slow(self, times_s: Sequence[float]) -> bool:
        """Whether answers after these times are too slow."""
        if not times_s:
            return False
        over_median = self.median is not None and median(times_s) > self.median
        return over_median or (self.most is not None and max(times_s) > self.most)


@check("timing.latency", Subject.RECORDING, Latency)
def latency(recording: Recording, parameters: Latency) -> Finding:
    """The node answers soon.

    The latency is the time from the probe's publishing of a message to the source timestamp of the
    node's answer. Answers are taken in their order, one for each message. Delays by the machine are
    measured and cost no points.
    """
    sent = recording.sent.get(parameters.stimulus, ())
    answers = recording.on(parameters.topic)
    if not answers:
        return why_silent(recording, parameters.topic)
    if not sent:
        return why_not_sent(recording, parameters.stimulus)
    within_ns = round(parameters.within * NS)
    answered = list(zip(sent, answers_to(sent, answers, within_ns), strict=True))
    waits = [(one.stamp_ns, answer.stamp_ns) for one, answer in answered if answer is not None]
    missing = [one.stamp_ns for one, answer in answered if answer is None]
    times_s = [(end_ns - begin_ns) / NS for begin_ns, end_ns in waits]
    figures = _figures(times_s)
    evidence = _evidence(recording, parameters, waits, missing)
    is_missing = len(missing) > parameters.unanswered
    if not is_missing and not parameters.is_too_slow(times_s):
        return Finding.as_asked(figures, evidence)
    observed = (
        f"{len(missing)} of {counted(len(sent), 'message')} on {code(parameters.stimulus)} "
        f"had no answer within {format_duration(parameters.within)}"
    )
    if is_missing:
        last_ns = missing[-1 - parameters.unanswered]
        stop_if(why_unsubscribed(recording, parameters.stimulus, observed, last_ns))
    own_s = [max(0.0, left_s(recording, *wait)) for wait in waits]
    excused = _excused(recording, [one.stamp_ns for one in sent], answers, within_ns)
    unexcused = len(set(missing) - excused)
    if unexcused <= parameters.unanswered and not parameters.is_too_slow(own_s):
        stolen_s = recording.stolen_s(sent[0].stamp_ns, recording.stop_ns)
        return Finding.held_up(figures, stolen_s)
    if not is_missing:
        return mistaken("slow_answer", figures, evidence)
    if waits:
        observed += f"; of the others {figures}"
    return mistaken("missing_answer", observed, evidence)


def _excused(
    recording: Recording, sent_ns: Sequence[int], answers: Sequence[Message], within_ns: int
) -> set[int]:
    """Those of the sent messages whose answer may be late, or not there, because of the machine.

    It can be late by what the machine took. It can be missing only where the machine took so long
    that the next message came before this one was taken out of its queue.
    """
    found = set()
    for time_ns, next_ns in zip_longest(sent_ns, sent_ns[1:], fillvalue=recording.stop_ns):
        limit_ns = time_ns + within_ns
        stolen_ns = round(recording.stolen_s(time_ns, limit_ns) * NS)
        latest_ns = recording.own_end_ns(time_ns, within_ns / NS)
        is_late = any(limit_ns < answer.stamp_ns <= latest_ns for answer in answers)
        in_queue_ns = min(next_ns, recording.stop_ns - within_ns) - time_ns
        if stolen_ns and (is_late or stolen_ns >= in_queue_ns):
            found.add(time_ns)
    return found


def _figures(times_s: Sequence[float]) -> str:
    if not times_s:
        return "no answers"
    return (
        f"median {format_duration(median(times_s))}, largest {format_duration(max(times_s))}, over "
        f"{counted(len(times_s), 'answer')}"
    )


def _evidence(
    recording: Recording,
    parameters: Latency,
    waits: Sequence[tuple[int, int]],
    missing: Sequence[int],
) -> Evidence:
    moments = [
        moment(recording, f"sent on {parameters.stimulus}, not answered", at) for at in missing[:10]
    ]
    if not waits:
        return Evidence(moments=tuple(moments))
    begin_ns, end_ns = max(waits, key=lambda wait: wait[1] - wait[0])
    slowest = f"slowest answer: after {format_duration((end_ns - begin_ns) / NS)}"
    moments.append(moment(recording, slowest, begin_ns))
    plot = Plot(
        title=f"From a message on {parameters.stimulus} to its answer",
        x_label="time since launch (s)",
        y_label="latency (ms)",
        x=tuple(recording.since_launch_s(begin_ns) for begin_ns, _ in waits),
        y=tuple((end_ns - begin_ns) / NS * _MS for begin_ns, end_ns in waits),
        band=(0.0, (parameters.most or parameters.median or 0.0) * _MS),
    )
    return Evidence(moments=tuple(moments), plots=(plot,))
