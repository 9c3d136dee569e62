"""Checks of what a node logs: that it follows messages that it was sent, or that it publishes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Literal

from pydantic import Field

from grader.checks.check import NamedFields, Parameters, Subject, check, stop_if
from grader.checks.need import SentOrOwn
from grader.diagnosis.explanation import cause_of, mistaken
from grader.diagnosis.no_log import NotLogged
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.process.not_called import Uncalled, slow_callbacks
from grader.findings.finding import Evidence, Finding, endpoints_seen, evidence_at
from grader.findings.value import FieldPath
from grader.findings.words import code, codes, counted
from grader.measure.printed import Echo, Wanted, echoes, quote, wanted_values
from grader.recording.model import NS, Kind, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

_BACKLOG_NS = NS
"""What the machine holds up so long before keeps later messages waiting."""
_SHOWN = 5
_SENT = {
    "any": "",
    "before_launch": " that were published before the launch",
    "after_launch": " that were published after the launch",
}


class Follows(Parameters):
    """Parameters of log.follows."""

    needs = (SentOrOwn(),)

    topic: TopicName = Field(
        description="Fully qualified name of a topic that the simulated robot or a stimulus sends; "
        "or with `own` a node of the student."
    )
    own: bool = Field(
        False,
        description="Whether the log shows what a node of the student publishes: a line may come "
        "before or after its message. By default it shows what the node was sent.",
    )
    fields: tuple[FieldPath, ...] = Field(
        min_length=1,
        description="Numbers of the message that must be logged, such as "
        "`pose.pose.position.x` or `ranges[0]`.",
    )
    decimals: int = Field(
        2,
        ge=0,
        le=9,
        description="How many decimals must be right. Rounding and truncating are both right.",
    )
    sent: Literal["any", "before_launch", "after_launch"] = Field(
        "any",
        description="Which messages count: those that a stimulus published before the launch of "
        "the node, after it, or all.",
    )
    at_least: int = Field(1, ge=1, description="How many messages must have their own log lines.")
    within: Duration = Field(
        0.5,
        description="Longest time from a message to its line. For a message from before the "
        "launch, the time counts from the first match.",
        validate_default=False,
    )
    every: Duration | None = Field(
        None,
        description="Longest time without such a line while messages come; by default any.",
    )

    def _asked(self) -> str:
        asked = (
            f"log lines that show {codes(self.fields)} of at least "
            f"{counted(self.at_least, 'message')} on {code(self.topic)}{_SENT[self.sent]} "
            f"(to {counted(self.decimals, 'decimal')}), each within {format_duration(self.within)}"
        )
        if self.every is not None:
            asked += f", and never longer than {format_duration(self.every)} without one"
        return asked

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields whose numbers are logged."""
        for number, field in enumerate(self.fields):
            yield NamedFields(("fields", number), self.topic, field)


@check("log.follows", Subject.RECORDING, Follows)
def follows(recording: Recording, parameters: Follows) -> Finding:
    """The node logs what it receives, or with `own` what it publishes.

    Lines on stdout and stderr (rclpy's loggers write to stderr) must follow messages on the topic
    and show the values of their fields. Any formatting is right: one line or several, rounded or
    exact, or the whole message. Other numbers and other lines do not matter. But a name directly
    before a number, as in `x = 1.37`, must not be the name of another field. The lines may come
    from a callback or from a timer.
    """
    carried = recording.carried(parameters.topic)
    own = recording.student_endpoints(Kind.PUBLISHER, parameters.topic)
    if parameters.own:
        stop_if(None if carried else why_silent(recording, parameters.topic))
    elif own:
        return mistaken(
            "echoed_sensor",
            f"the node itself publishes on {code(parameters.topic)}, so its log shows nothing of "
            "what it was sent",
            Evidence(moments=endpoints_seen(recording, own)),
        )
    messages = [
        message
        for message in carried
        if parameters.sent == "any"
        or (parameters.sent == "before_launch") == (message.stamp_ns < recording.launched_ns)
    ]
    ready_ns = recording.matched_ns or recording.launched_ns
    within_ns = round(parameters.within * NS)
    sooner_ns = within_ns if parameters.own else 0
    wanted = wanted_values(messages, parameters.fields, ready_ns, sooner_ns)
    found = echoes(recording, wanted, parameters.decimals, within_ns)
    if len(found) < parameters.at_least:
        symptom = NotLogged(
            recording,
            parameters.topic,
            wanted,
            found,
            needed=parameters.at_least,
            decimals=parameters.decimals,
            within_ns=within_ns,
            own=parameters.own,
        )
        return cause_of(symptom)
    stop_if(_too_seldom(recording, parameters, wanted, found))
    lines = [line for echo in found for line in echo.lines]
    number, last = counted(len(messages), "message"), lines[-1]
    label, log = f"logged a message on {parameters.topic}", (one.text for one in lines[:_SHOWN])
    return Finding.as_asked(
        f"log lines follow {len(found)} of {number}: {quote(last.text)}",
        evidence_at(recording, label, last.time_ns, log=log),
    )


def _too_seldom(
    recording: Recording, parameters: Follows, wanted: Sequence[Wanted], found: Sequence[Echo]
) -> Finding | None:
    """Why there was no line for too long while messages came, or None."""
    if parameters.every is None:
        return None
    begin_ns, end_ns = wanted[0].due_ns, wanted[-1].due_ns
    written = sorted(min(echo.lines[-1].time_ns, end_ns) for echo in found)
    gaps = list(pairwise([begin_ns, *written, end_ns]))
    gap = max(gaps, key=lambda one: _own_s(recording, one))
    excused = _own_s(recording, gap) <= parameters.every
    if excused:
        gap = max(gaps, key=lambda one: one[1] - one[0])
    gap_s = (gap[1] - gap[0]) / NS
    if gap_s <= parameters.every:
        return None
    begin_s = recording.since_launch_s(gap[0])
    observed = f"no such line for {format_duration(gap_s)}, from {begin_s:.2f} s after launch on"
    if excused:
        return Finding.undecided(f"{observed}, but the machine took the time from the process")
    observed += f", although messages came on {code(parameters.topic)}"
    kind = Kind.PUBLISHER if parameters.own else Kind.SUBSCRIPTION
    nodes = {item.node for item in recording.student_endpoints(kind, parameters.topic)}
    shown = evidence_at(recording, "no line from here on", gap[0])
    slow = slow_callbacks(Uncalled(recording, observed, nodes))
    return slow or mistaken("seldom", observed, shown)


def _own_s(recording: Recording, gap: tuple[int, int]) -> float:
    """How long a gap is without what the machine took in it, and shortly before."""
    begin_ns, end_ns = gap
    return (end_ns - begin_ns) / NS - recording.stolen_s(begin_ns - _BACKLOG_NS, end_ns)
