"""Checks of what a node logs: that it follows messages that it was sent, or that it publishes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from pydantic import Field

from grader.checks.check import NamedFields, Parameters, Subject, check, stop_if
from grader.checks.need import SentOrOwn
from grader.diagnosis.explanation import cause_of, mistaken
from grader.diagnosis.no_log import PublishedNotLogged, ReceivedNotLogged
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.process.not_called import Uncalled, slow_callbacks
from grader.findings.finding import Evidence, Finding, endpoints_seen, evidence_at
from grader.findings.value import FieldPath
from grader.findings.words import code, codes, counted
from grader.measure.printed import Echo, Wanted, echoes, quote, wanted_values
from grader.recording.model import NS, Kind, Message, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

# What the machine holds up so long before a gap still keeps messages waiting in it.
_BACKLOG_NS = NS
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
        None, description="Longest time without such a line while messages come; by default any."
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

    def counts(self, recording: Recording, message: Message) -> bool:
        """Whether a message must be logged, by when it was published."""
        if self.sent == "any":
            return True
        is_before = message.stamp_ns < recording.launched_ns
        return is_before if self.sent == "before_launch" else not is_before

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
    own_publishers = recording.student_endpoints(Kind.PUBLISHER, parameters.topic)
    if parameters.own and not carried:
        return why_silent(recording, parameters.topic)
    if own_publishers and not parameters.own:
        return mistaken(
            "echoed_sensor",
            f"the node itself publishes on {code(parameters.topic)}, so its log shows nothing of "
            "what it was sent",
            Evidence(moments=endpoints_seen(recording, own_publishers)),
        )
    messages = [message for message in carried if parameters.counts(recording, message)]
    ready_ns = recording.matched_ns or recording.launched_ns
    within_ns = round(parameters.within * NS)
    sooner_ns = within_ns if parameters.own else 0
    wanted = wanted_values(messages, parameters.fields, ready_ns, sooner_ns)
    logged = echoes(recording, wanted, parameters.decimals, within_ns)
    if len(logged) < parameters.at_least:
        not_logged = PublishedNotLogged if parameters.own else ReceivedNotLogged
        symptom = not_logged(
            recording,
            parameters.topic,
            wanted,
            logged,
            needed=parameters.at_least,
            decimals=parameters.decimals,
            within_ns=within_ns,
        )
        return cause_of(symptom)
    stop_if(_why_too_seldom(recording, parameters, wanted, logged))
    lines = [line for echo in logged for line in echo.lines]
    shown = evidence_at(
        recording,
        f"logged a message on {parameters.topic}",
        lines[-1].time_ns,
        log=(line.text for line in lines[:_SHOWN]),
    )
    number = counted(len(messages), "message")
    last = quote(lines[-1].text)
    return Finding.as_asked(f"log lines follow {len(logged)} of {number}: {last}", shown)


def _why_too_seldom(
    recording: Recording, parameters: Follows, wanted: Sequence[Wanted], logged: Sequence[Echo]
) -> Finding | None:
    """Why there was no line for too long while messages came, or None."""
    if parameters.every is None:
        return None
    gaps = list(_gaps(recording, wanted, logged))
    # The machine makes a gap longer, so the one that is too long without its time decides.
    longest = max(gaps, key=lambda gap: gap.own_s)
    machine_may_explain = longest.own_s <= parameters.every
    if machine_may_explain:
        longest = max(gaps, key=lambda gap: gap.seconds)
    if longest.seconds <= parameters.every:
        return None
    begin_s = recording.since_launch_s(longest.begin_ns)
    observed = (
        f"no such line for {format_duration(longest.seconds)}, from {begin_s:.2f} s after launch on"
    )
    if machine_may_explain:
        return Finding.undecided(f"{observed}, but the machine took the time from the process")
    observed += f", although messages came on {code(parameters.topic)}"
    kind = Kind.PUBLISHER if parameters.own else Kind.SUBSCRIPTION
    nodes = {item.node for item in recording.student_endpoints(kind, parameters.topic)}
    slow = slow_callbacks(Uncalled(recording, observed, nodes))
    shown = evidence_at(recording, "no line from here on", longest.begin_ns)
    return slow or mistaken("seldom", observed, shown)


@dataclass(frozen=True)
class _Gap:
    """A time without a line; ``own_s`` is its length without what the machine took."""

    begin_ns: int
    seconds: float
    own_s: float


def _gaps(recording: Recording, wanted: Sequence[Wanted], logged: Sequence[Echo]) -> Iterator[_Gap]:
    """The times from line to line while messages came."""
    first_ns, last_ns = wanted[0].due_ns, wanted[-1].due_ns
    written_ns = sorted(min(echo.lines[-1].time_ns, last_ns) for echo in logged)
    for begin_ns, end_ns in pairwise([first_ns, *written_ns, last_ns]):
        seconds = (end_ns - begin_ns) / NS
        stolen_s = recording.stolen_s(begin_ns - _BACKLOG_NS, end_ns)
        yield _Gap(begin_ns, seconds, seconds - stolen_s)
