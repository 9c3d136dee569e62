"""What a subscription that comes late gets of what was published before it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment, Table
from grader.checks.need import Joined
from grader.checks.wording import code, counted
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_unpublished
from grader.diagnosis.few_messages import why_few
from grader.diagnosis.process.process_exit import why_ended
from grader.measure import declarations
from grader.measure.compatibility import compatibility_table, refusals
from grader.measure.numbering import published
from grader.recording.model import NS, Join, Kind, Message, Recording
from grader.spec.name import Id, TopicName
from grader.spec.unit import format_duration

_SHOWN = 50
_ONE_PUBLISHER_HINT = (
    "Call create_publisher once, in the constructor of the node, and not in a callback."
)


class LateJoiner(Parameters):
    """Parameters of qos.late_joiner."""

    needs = (Joined(),)

    topic: TopicName = Field(
        description="Fully qualified topic name. Where the scenario does not record it, the late "
        "joiner is the only subscription to it."
    )
    joiner: Id = Field(description="The `name` of a `join` among the stimuli.")
    last: int = Field(
        ge=0, description="So many of the messages before it joined it must get, and no more."
    )


@check("qos.late_joiner", Subject.RECORDING, LateJoiner)
def late_joiner(recording: Recording, parameters: LateJoiner) -> Finding:
    """A late joiner gets the last messages, and no more.

    Judged by behaviour: a subscription of the probe joins in the middle of the run, and gets the
    last messages that were published before (`last` of them, or none for 0), as the durability
    and depth of the publisher make it. Messages that were published just while it was matched
    may count on either side.

    A scenario that records the topic subscribes to it from the start. In one that does not, there
    is no subscription until the late joiner's; how many messages came before tell the numbers
    that the publisher's middleware gives them. So a publisher is found out that publishes only
    while there is a subscription.
    """
    expected = _expected_words(parameters)
    join = next((item for item in recording.joins if item.name == parameters.joiner), None)
    if join is None:
        return _not_judged(recording, parameters, join, 0, expected)
    got = recording.joined.get(parameters.joiner, ())
    history = _before(got, join.joined_ns)
    heard = recording.on(parameters.topic)
    before = _Before.heard(heard, join) if heard else _Before.told_by(got, history)
    if before.number <= parameters.last:
        if heard or not got:
            return _not_judged(recording, parameters, join, before.number, expected)
        return _waited(recording, parameters, join, before, expected)
    evidence = _evidence(recording, join, before.messages, history)
    # What is kept arrives with the match, so that what was published later is live.
    first_ns = min((item.received_ns for item in got), default=join.joined_ns)
    meanwhile = sum(join.joined_ns < item.stamp_ns <= first_ns for item in heard or got)
    least = max(0, parameters.last - meanwhile)
    if least <= len(history) <= parameters.last and _is_newest(history, before.messages):
        return Finding.passed(expected, _seen(history, before), evidence)
    publishers = recording.student_endpoints(Kind.PUBLISHER, parameters.topic)
    if len(history) > parameters.last and len(publishers) > 1:
        return Finding.failed(
            expected,
            f"{_seen(history, before)}, of {len(publishers)} publishers, each of which keeps its "
            "own",
            _ONE_PUBLISHER_HINT,
            evidence,
        )
    if len(history) > parameters.last:
        return Finding.failed(
            expected,
            _seen(history, before) + _why_many(recording, parameters, history, before),
            _hint(parameters),
            evidence,
        )
    if not _is_newest(history, before.messages):
        return Finding.to_repeat(
            expected,
            f"{_seen(history, before)}, but not the newest ones: some were lost on their way",
        )
    return _too_few(recording, parameters, join, history, before, evidence, expected)


@dataclass(frozen=True)
class _Before:
    """What was published before a late joiner was there."""

    messages: list[Message]
    number: int

    @classmethod
    def heard(cls, messages: tuple[Message, ...], join: Join) -> _Before:
        """Of a topic that was recorded from the start."""
        found = _before(messages, join.joined_ns)
        return cls(found, len(found))

    @classmethod
    def told_by(cls, got: tuple[Message, ...], history: list[Message]) -> _Before:
        """Of a topic that only the late joiner subscribed to: the messages are numbered."""
        if history:
            return cls(history, published(tuple(history)))
        return cls([], published(got[:1]) - 1 if got else 0)


def _expected_words(parameters: LateJoiner) -> str:
    if parameters.last == 0:
        return f"a late joiner on {code(parameters.topic)} gets nothing of what was before it"
    return (
        f"a late joiner on {code(parameters.topic)} gets the last "
        f"{counted(parameters.last, 'message')} of those before it, and no more"
    )


def _before(messages: tuple[Message, ...], time_ns: int) -> list[Message]:
    return sorted(
        (item for item in messages if item.stamp_ns <= time_ns),
        key=lambda item: (item.stamp_ns, item.sequence),
    )


def _is_newest(history: list[Message], before: list[Message]) -> bool:
    """Whether what came is the newest of what was published, without a gap."""
    if not history:
        return True
    stamps = {item.stamp_ns for item in history}
    expected = {item.stamp_ns for item in before[-len(history) :]}
    return stamps == expected


def _seen(history: list[Message], before: _Before) -> str:
    return f"it got {len(history)} of the {counted(before.number, 'message')} before it"


def _not_judged(
    recording: Recording,
    parameters: LateJoiner,
    join: Join | None,
    number: int,
    expected: str,
) -> Finding:
    """Nobody joined, or too little had been published to see what is kept of it."""
    needed = parameters.last + 1
    if len(recording.on(parameters.topic)) < needed:
        return why_few(recording, parameters.topic, needed).finding(expected)
    seen = (
        "the run ended before it joined"
        if join is None
        else f"when it joined, only {counted(number, 'message')} had been published of the "
        f"{needed} that are needed to judge"
    )
    return (why_ended(recording, seen) or Cause(seen, ours=True)).finding(expected)


def _waited(
    recording: Recording, parameters: LateJoiner, join: Join, before: _Before, expected: str
) -> Finding:
    """Until the late joiner was there, little or nothing was published to no subscription."""
    seen = f"before it, {counted(before.number, 'message')} had been published to no subscription"
    evidence = _evidence(recording, join, before.messages, before.messages)
    begin_ns = recording.matched_ns or recording.launched_ns
    span_s = (join.joined_ns - begin_ns) / NS
    stolen_s = recording.stolen_s(begin_ns, join.joined_ns)
    made_anew = _made_anew(recording, parameters, join)
    if made_anew:
        return Finding.failed(expected, f"{seen}: {made_anew}", _ONE_PUBLISHER_HINT, evidence)
    # With the time that was taken from it, the node may have come to as many as are needed.
    if before.number * span_s > parameters.last * (span_s - stolen_s):
        return Finding.to_repeat(expected, f"{seen}; the machine took {format_duration(stolen_s)}")
    return Finding.failed(
        expected,
        f"{seen} in {format_duration(span_s)}",
        "Publish from the start, whether or not there is a subscription: leave out conditions such "
        "as get_subscription_count() > 0. What comes before the late joiner is kept for it.",
        evidence,
    )


def _made_anew(recording: Recording, parameters: LateJoiner, join: Join) -> str:
    """That earlier publishers took along what they kept, or nothing."""
    publishers = recording.student_endpoints(Kind.PUBLISHER, parameters.topic)
    gone = [item for item in publishers if (item.vanished_ns or math.inf) <= join.joined_ns]
    if not gone or len(gone) == len(publishers):
        return ""
    return (
        "what a publisher keeps is lost with it, and "
        f"{counted(len(gone), 'publisher was', 'publishers were')} destroyed before it joined"
    )


def _why_many(
    recording: Recording, parameters: LateJoiner, history: list[Message], before: _Before
) -> str:
    queues = declarations.queues(recording, Kind.PUBLISHER, parameters.topic)
    if any(queue.history == "keep_all" for queue in queues):
        return ": the publisher's history is keep_all, declared by the process"
    depths = [queue.depth for queue in queues if queue.depth is not None]
    if depths and depths[0] != parameters.last:
        return f": the publisher's depth is {depths[0]}, declared by the process"
    if len(history) == before.number:
        return ": all that there were"
    return f": the publisher keeps {len(history)}"


def _too_few(
    recording: Recording,
    parameters: LateJoiner,
    join: Join,
    history: list[Message],
    before: _Before,
    evidence: Evidence,
    expected: str,
) -> Finding:
    publishers = recording.student_endpoints(Kind.PUBLISHER, parameters.topic)
    for publisher in publishers:
        refused = refusals(publisher.qos, join.qos)
        if refused:
            return Finding.failed(
                expected,
                f"it got nothing at all: {', '.join(refused)}",
                f"{_hint(parameters)} A subscription receives nothing from a publisher that offers "
                "less than it requests.",
                Evidence(
                    evidence.moments,
                    tables=(compatibility_table(publisher.qos, join.qos), *evidence.tables),
                ),
            )
    lifespans = [item.qos.lifespan_s for item in publishers if item.qos.lifespan_s is not None]
    known = len(before.messages) >= parameters.last
    oldest_ns = before.messages[-parameters.last].stamp_ns if known else recording.launched_ns
    age_s = (join.joined_ns - oldest_ns) / NS
    if lifespans and min(lifespans) < age_s:
        return Finding.failed(
            expected,
            f"{_seen(history, before)}: the publisher's lifespan is "
            f"{format_duration(min(lifespans))}, and what is older is thrown away",
            "Leave `lifespan` out of the QoSProfile: then a message stays until newer ones take "
            "its place in the queue.",
            evidence,
        )
    if join.matched_ns is None:
        destroyed = why_unpublished(recording, parameters.topic, _seen(history, before))
        if destroyed is not None:
            return destroyed.finding(expected)
    stolen_s = recording.stolen_s(join.joined_ns, recording.stop_ns)
    if join.matched_ns is None and publishers:
        return Finding.to_repeat(
            expected,
            f"the late joiner was not matched within "
            f"{format_duration((recording.stop_ns - join.joined_ns) / NS)}"
            + (f"; the machine took {format_duration(stolen_s)} meanwhile" if stolen_s else ""),
        )
    depths = [
        queue.depth
        for queue in declarations.queues(recording, Kind.PUBLISHER, parameters.topic)
        if queue.depth is not None
    ]
    why = f": the publisher's depth is {depths[0]}, declared by the process" if depths else ""
    made_anew = _made_anew(recording, parameters, join)
    if made_anew:
        return Finding.failed(
            expected, f"{_seen(history, before)}: {made_anew}", _ONE_PUBLISHER_HINT, evidence
        )
    if depths and depths[0] >= parameters.last:
        return Finding.to_repeat(
            expected,
            f"{_seen(history, before)}, although the publisher's depth is {depths[0]}: the rest "
            "was lost on its way",
        )
    return Finding.failed(expected, _seen(history, before) + why, _hint(parameters), evidence)


def _hint(parameters: LateJoiner) -> str:
    if parameters.last == 0:
        return "A volatile publisher keeps nothing for late joiners: that is the default."
    return (
        "Give create_publisher a profile that keeps messages for late joiners: QoSProfile("
        f"history=HistoryPolicy.KEEP_LAST, depth={parameters.last}, "
        "durability=DurabilityPolicy.TRANSIENT_LOCAL)."
    )


def _evidence(
    recording: Recording, join: Join, before: list[Message], history: list[Message]
) -> Evidence:
    got = {item.stamp_ns for item in history}
    rows = tuple(
        (
            str(number),
            f"{recording.since_launch_s(item.stamp_ns):.2f} s",
            "yes" if item.stamp_ns in got else "no",
        )
        for number, item in enumerate(before, start=1)
    )
    title = f"Messages before {join.name} joined"
    moments = [Moment(f"{join.name} joined", recording.since_launch_s(join.joined_ns))]
    if join.matched_ns is not None:
        moments.append(Moment(f"{join.name} matched", recording.since_launch_s(join.matched_ns)))
    header = ("message", "published after launch", "got by the late joiner")
    return Evidence(tuple(moments), tables=(Table(title, header, rows[-_SHOWN:]),))
