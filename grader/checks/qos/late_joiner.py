"""What a subscription that comes late gets of what was published before it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Act, Stimulated
from grader.diagnosis.destroyed_endpoint import why_unpublished
from grader.diagnosis.no_messages import why_few
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.finding import Evidence, Finding, Moment, Table
from grader.findings.wording import code, counted
from grader.findings.words import worded
from grader.measure import declarations
from grader.measure.compatibility import compatibility_table, refusals
from grader.measure.numbering import published
from grader.recording.model import NS, Endpoint, Join, Kind, Message, Recording
from grader.spec.name import Id, TopicName
from grader.spec.unit import format_duration

_SHOWN = 50
_ONE_PUBLISHER_HINT = (
    "Call create_publisher once, in the constructor of the node, and not in a callback."
)


class LateJoiner(Parameters):
    """Parameters of qos.late_joiner."""

    needs = (Stimulated(Act.JOIN, "joiner"),)

    topic: TopicName = Field(
        description="Fully qualified topic name. If the scenario does not record it, the late "
        "joiner is the only subscription."
    )
    joiner: Id = Field(description="The `name` of a `join` among the stimuli.")
    last: int = Field(
        ge=0, description="How many of the messages from before it joined the late joiner must get."
    )

    def _asked(self) -> str:
        who = f"a late joiner on {code(self.topic)} gets"
        if self.last == 0:
            return f"{who} no message published before it"
        return f"{who} the last {counted(self.last, 'message')} published before it, and no more"


@check("qos.late_joiner", Subject.RECORDING, LateJoiner, concept="qos")
def late_joiner(recording: Recording, parameters: LateJoiner) -> Finding:
    """A late joiner gets the last messages, and no more.

    Judged by behaviour: a subscription of the probe joins in the middle of the run, and gets the
    last messages that were published before (`last` of them, or none for 0), as the durability
    and depth of the publisher make it. Messages that were published just while it was matched
    may count as before or after.

    A scenario that records the topic subscribes to it from the start. Without `record`, there
    is no subscription until the late joiner's; the sequence numbers of the publisher's middleware
    show how many messages came before. So the check detects a publisher that publishes only while
    there is a subscription.
    """
    join = next((item for item in recording.joins if item.name == parameters.joiner), None)
    if join is None:
        return _why_not_judged(recording, parameters, "the run ended before it joined")
    case = _Case.of(recording, parameters, join)
    stop_if(_why_wrong(case))
    return Finding.passed(parameters.asked_for, case.seen, case.evidence)


@dataclass(frozen=True)
class _Case:
    """What a late joiner got, and what had been published before it joined.

    Attributes:
        history: What it got of what was published before.
        before: What was published before, as far as the recording has it.
        number: How many messages were published before.
        least: How many of them it must get. A message that was published while it was matched
            may count on either side.
    """

    recording: Recording
    parameters: LateJoiner
    join: Join
    history: list[Message]
    before: list[Message]
    number: int
    least: int

    @classmethod
    def of(cls, recording: Recording, parameters: LateJoiner, join: Join) -> _Case:
        got = recording.joined.get(join.name, ())
        heard = recording.on(parameters.topic)
        history = _published_until(got, join.joined_ns)
        before = _published_until(heard, join.joined_ns) if heard else history
        number = len(before)
        # Where nothing else was subscribed, the writer's numbers tell.
        if not heard:
            number = published(history) if history else published(got[:1]) - 1 if got else 0
        # What is kept arrives with the match, so that what was published later is live.
        first_ns = min((item.received_ns for item in got), default=join.joined_ns)
        meanwhile = sum(join.joined_ns < item.stamp_ns <= first_ns for item in heard or got)
        least = max(0, parameters.last - meanwhile)
        return cls(recording, parameters, join, history, before, number, least)

    @property
    def seen(self) -> str:
        before = f"{counted(self.number, 'message')} published before it"
        return f"it got {len(self.history)} of the {before}"

    @property
    def is_newest(self) -> bool:
        """Whether what came is the newest of what was published, without a gap."""
        newest = self.before[-len(self.history) :] if self.history else []
        return {item.stamp_ns for item in self.history} == {item.stamp_ns for item in newest}

    @property
    def publishers(self) -> tuple[Endpoint, ...]:
        return self.recording.student_endpoints(Kind.PUBLISHER, self.parameters.topic)

    @property
    def depths(self) -> list[int]:
        """The depths of these publishers, as the process declared them."""
        queues = declarations.queues(self.recording, Kind.PUBLISHER, self.parameters.topic)
        return [queue.depth for queue in queues if queue.depth is not None]

    @property
    def hint(self) -> str:
        if self.parameters.last == 0:
            return "A volatile publisher keeps nothing for late joiners: that is the default."
        return "Give create_publisher a profile that keeps messages for late joiners: " + worded(
            python=f"QoSProfile(history=HistoryPolicy.KEEP_LAST, depth={self.parameters.last}, "
            "durability=DurabilityPolicy.TRANSIENT_LOCAL).",
            cpp=f"rclcpp::QoS({self.parameters.last}).transient_local().",
        )

    @property
    def evidence(self) -> Evidence:
        got = {item.stamp_ns for item in self.history}
        rows = tuple(
            (
                str(number),
                f"{self.recording.since_launch_s(item.stamp_ns):.2f} s",
                "yes" if item.stamp_ns in got else "no",
            )
            for number, item in enumerate(self.before, start=1)
        )
        name = self.join.name
        times = {"joined": self.join.joined_ns, "matched": self.join.matched_ns}
        moments = tuple(
            Moment(f"{name} {what}", self.recording.since_launch_s(time_ns))
            for what, time_ns in times.items()
            if time_ns is not None
        )
        header = ("message", "published after launch", "got by the late joiner")
        table = Table(f"Messages before {name} joined", header, rows[-_SHOWN:])
        return Evidence(moments, tables=(table,))

    def why_destroyed(self, seen: str) -> Finding | None:
        """The cause if publishers were destroyed before it joined, while another one was there."""
        ends = [item.vanished_ns or math.inf for item in self.publishers]
        gone = sum(end_ns <= self.join.joined_ns for end_ns in ends)
        if gone in (0, len(ends)):
            return None
        number = counted(gone, "publisher was", "publishers were")
        lost = "what a publisher keeps is lost with it"
        observed = f"{seen}: {number} destroyed before it joined, and {lost}"
        return Finding(observed, _ONE_PUBLISHER_HINT, self.evidence)


def _published_until(messages: tuple[Message, ...], time_ns: int) -> list[Message]:
    return sorted(
        (item for item in messages if item.stamp_ns <= time_ns),
        key=lambda item: (item.stamp_ns, item.sequence),
    )


def _why_not_judged(recording: Recording, parameters: LateJoiner, seen: str) -> Finding:
    """Why it did not join, or too little had been published to see what is kept of it."""
    needed = parameters.last + 1
    if len(recording.on(parameters.topic)) < needed:
        return why_few(recording, parameters.topic, needed)
    return why_ended(recording, seen) or Finding.ours(seen)


def _why_wrong(case: _Case) -> Finding | None:
    """Why it did not get what it should, or None."""
    number, last = len(case.history), case.parameters.last
    if case.number <= last:
        heard = case.recording.on(case.parameters.topic)
        if not heard and case.recording.joined.get(case.join.name):
            return _why_unpublished_before(case)
        published_before = f"only {counted(case.number, 'message')} had been published"
        seen = f"when it joined, {published_before} of the {last + 1} that are needed to judge"
        return _why_not_judged(case.recording, case.parameters, seen)
    if number > last:
        return _why_too_many(case)
    if not case.is_newest:
        return Finding.undecided(
            f"{case.seen}, but not the newest ones: some were lost on their way"
        )
    return _why_too_few(case) if number < case.least else None


def _why_unpublished_before(case: _Case) -> Finding:
    """Why little or nothing was published before the late joiner, the only subscription."""
    recording, join = case.recording, case.join
    number = counted(case.number, "message was", "messages were")
    seen = f"{number} published before it, while there was no subscription"
    destroyed = case.why_destroyed(seen)
    if destroyed is not None:
        return destroyed
    begin_ns = recording.matched_ns or recording.launched_ns
    span_s = (join.joined_ns - begin_ns) / NS
    stolen_s = recording.stolen_s(begin_ns, join.joined_ns)
    # With the time that was taken from it, the node may have come to as many as are needed.
    if case.number * span_s > case.parameters.last * (span_s - stolen_s):
        return Finding.held_up(seen, stolen_s)
    return Finding(
        f"{seen} ({format_duration(span_s)})",
        "Publish from the start, whether or not there is a subscription: leave out conditions such "
        "as get_subscription_count() > 0. What comes before the late joiner is kept for it.",
        case.evidence,
    )


def _why_too_many(case: _Case) -> Finding:
    if len(case.publishers) > 1:
        each = f"of {len(case.publishers)} publishers, each of which keeps its own"
        return Finding(f"{case.seen}, {each}", _ONE_PUBLISHER_HINT, case.evidence)
    queues = declarations.queues(case.recording, Kind.PUBLISHER, case.parameters.topic)
    if any(queue.history == "keep_all" for queue in queues):
        why = "the publisher's history is keep_all, declared by the process"
    elif case.depths and case.depths[0] != case.parameters.last:
        why = f"the publisher's depth is {case.depths[0]}, declared by the process"
    else:
        why = f"the publisher keeps {len(case.history)}"
    return Finding(f"{case.seen}: {why}", case.hint, case.evidence)


def _why_too_few(case: _Case) -> Finding:
    recording, join, last = case.recording, case.join, case.parameters.last
    for publisher in case.publishers:
        refused = refusals(publisher.qos, join.qos)
        if refused:
            table = compatibility_table(publisher.qos, join.qos)
            return Finding(
                f"it got nothing at all: {', '.join(refused)}",
                f"{case.hint} A subscription receives nothing from a publisher that offers less "
                "than it requests.",
                replace(case.evidence, tables=(table, *case.evidence.tables)),
            )
    lifespans = [item.qos.lifespan_s for item in case.publishers if item.qos.lifespan_s is not None]
    known = len(case.before) >= last
    oldest_ns = case.before[-last].stamp_ns if known else recording.launched_ns
    if lifespans and min(lifespans) < (join.joined_ns - oldest_ns) / NS:
        return Finding(
            f"{case.seen}: the publisher's lifespan is {format_duration(min(lifespans))}, and what "
            "is older is thrown away",
            f"Leave `lifespan` out of the {worded('QoSProfile', 'rclcpp::QoS')}: then a message "
            "stays until newer ones take its place in the queue.",
            case.evidence,
        )
    if join.matched_ns is None and case.publishers:
        waited_s = format_duration((recording.stop_ns - join.joined_ns) / NS)
        return why_unpublished(recording, case.parameters.topic, case.seen) or Finding.undecided(
            f"the late joiner was not matched within {waited_s}"
        )
    destroyed = case.why_destroyed(case.seen)
    if destroyed is not None:
        return destroyed
    depth = case.depths[0] if case.depths else None
    if depth is None:
        return Finding(case.seen, case.hint, case.evidence)
    if depth >= last:
        return Finding.undecided(
            f"{case.seen}, although the publisher's depth is {depth}: the rest was lost on its way"
        )
    why = f"the publisher's depth is {depth}, declared by the process"
    return Finding(f"{case.seen}: {why}", case.hint, case.evidence)
