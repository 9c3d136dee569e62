"""Why the student has no publisher or subscription on a topic, near misses first."""

from __future__ import annotations

import re
from collections.abc import Iterable

from grader.checks import declarations
from grader.checks.finding import Evidence, Table
from grader.checks.first_seen import endpoints_seen, nodes_seen
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.exchanged_executables import why_exchanged
from grader.diagnosis.near_name import Named, why_misnamed
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.process_exit import crashed, why_it_exited
from grader.recording.model import Endpoint, Kind, Owner, Recording

# Every rclpy node has these by itself; they say nothing of what the student wrote.
OWN_TOPICS = frozenset({"/rosout", "/parameter_events", "/clock"})

# The name becomes an argument, and a DDS participant that is not of ROS may use any.
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")

_CREATE = {Kind.PUBLISHER: "create_publisher", Kind.SUBSCRIPTION: "create_subscription"}
_DOES = {Kind.PUBLISHER: "publishes on", Kind.SUBSCRIPTION: "subscribes to"}
_DOES_NOTHING = {Kind.PUBLISHER: "publishes nothing", Kind.SUBSCRIPTION: "subscribes to nothing"}
_OTHER = {Kind.PUBLISHER: Kind.SUBSCRIPTION, Kind.SUBSCRIPTION: Kind.PUBLISHER}


def why_no_endpoint(recording: Recording, kind: Kind, topic: str) -> Cause | None:
    """Why the student has no such endpoint on a topic, or None if there is one."""
    if recording.student_endpoints(kind, topic):
        return None
    if kind is Kind.PUBLISHER and _only_students_publish(recording, topic):
        return None
    cause = why_no_node(recording)
    if cause is not None:
        return cause
    own = [item for item in recording.student_endpoints(kind) if item.topic not in OWN_TOPICS]
    evidence = Evidence(
        moments=endpoints_seen(recording, own) or nodes_seen(recording),
        tables=_endpoints_table(recording),
    )
    ended = crashed(recording)
    # What a process that lives has is no misspelling of what a dead one never came to create.
    suspects = [
        item
        for item in own
        if not ended or declarations.process_of(recording, item.node) in (None, *ended)
    ]
    near = why_misnamed(
        topic,
        [Named(item.topic, item.node) for item in suspects],
        f"the node {_DOES[kind]}",
        f"Write the topic's name as '{topic.rpartition('/')[2]}' in self.{_CREATE[kind]}(...).",
        evidence,
    )
    if near is not None:
        return near
    if ended:
        return why_it_exited(recording, ended[0])
    if declarations.declares(recording, kind.value, "topic", topic):
        return declarations.why_never_appeared(recording, f"a {kind.value} on {code(topic)}")
    exchanged = why_exchanged(recording)
    if exchanged is not None:
        return exchanged.after(f"there is no {kind.value} on {code(topic)}")
    if recording.student_endpoints(_OTHER[kind], topic):
        other = _OTHER[kind]
        return Cause(
            f"the node {_DOES[other]} {code(topic)} instead: found a {other.value} there, "
            f"no {kind.value}",
            f"Use self.{_CREATE[kind]}(...) where the node has self.{_CREATE[other]}(...).",
            evidence,
        )
    return _elsewhere(recording, kind, topic, own, evidence)


def misnamed(recording: Recording, kind: Kind, topic: str) -> str:
    """The remapping rule for the one endpoint of the right type on a topic that nobody else has.

    Returns:
        Such as ``/cmdvel:=/cmd_vel``; empty where there is no such endpoint, or more than one, or
        where the rule has been tried.
    """
    others = [item for item in recording.endpoints if item.owner is not Owner.STUDENT]
    wanted = {item.type for item in others if item.topic == topic}
    asked_for = {item.topic for item in others} | OWN_TOPICS
    found = {
        item.topic
        for item in recording.student_endpoints(kind)
        if item.type in wanted and item.topic not in asked_for and _NAME.fullmatch(item.topic)
    }
    rule = f"{found.pop()}:={topic}" if len(found) == 1 else ""
    return "" if rule in recording.remaps else rule


def _only_students_publish(recording: Recording, topic: str) -> bool:
    """Whether messages came that nobody but the student can have published."""
    others = (
        item.owner is not Owner.STUDENT and item.kind is Kind.PUBLISHER and item.topic == topic
        for item in recording.endpoints
    )
    return bool(recording.on(topic)) and not any(others)


def _elsewhere(
    recording: Recording, kind: Kind, topic: str, own: list[Endpoint], evidence: Evidence
) -> Cause:
    """Nothing near: name what there is, or that there is nothing."""
    create = f"self.{_CREATE[kind]}(...)"
    if not own:
        return Cause(
            f"the node {codes(node.name for node in recording.student_nodes)} "
            f"{_DOES_NOTHING[kind]} (/rosout and /parameter_events belong to every node)",
            f"Call {create} in the node's constructor.",
            evidence,
        )
    wanted = {item.type for item in _probe_endpoints(recording, topic)}
    same = [item.topic for item in own if item.type in wanted]
    if same:
        return Cause(
            f"the right type of message, but on another topic: the node {_DOES[kind]} "
            f"{codes(same)}",
            f"Write the topic's name as '{topic.lstrip('/')}' in {create}.",
            evidence,
        )
    return Cause(
        f"the node {_DOES[kind]} {codes(item.topic for item in own)} only",
        f"Call {create} with the topic '{topic.lstrip('/')}'.",
        evidence,
    )


def _probe_endpoints(recording: Recording, topic: str) -> Iterable[Endpoint]:
    return (
        item for item in recording.endpoints if item.owner is Owner.PROBE and item.topic == topic
    )


def _endpoints_table(recording: Recording) -> tuple[Table, ...]:
    rows = [
        (item.node, item.kind.value, item.topic, item.type)
        for item in recording.endpoints
        if item.owner is Owner.STUDENT and item.topic not in OWN_TOPICS
    ]
    if not rows:
        return ()
    header = ("node", "endpoint", "topic", "type")
    return (Table("What the student's nodes publish and subscribe to", header, tuple(rows[:50])),)
