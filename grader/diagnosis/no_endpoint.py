"""Why the student has no publisher or subscription on a topic, near misses first."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from grader.checks.finding import Evidence, Table
from grader.checks.first_seen import endpoints_seen, nodes_seen
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.exchanged_executables import why_exchanged
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.near_name import Named, why_misnamed
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.process_exit import crashed, why_it_exited
from grader.diagnosis.undeclared import why_never_appeared
from grader.measure import declarations
from grader.recording.model import Endpoint, Kind, Owner, Recording

# Every rclpy node has these by itself; they say nothing of what the student wrote.
OWN_TOPICS = frozenset({"/rosout", "/parameter_events", "/clock"})

# The name becomes an argument, and a DDS participant that is not of ROS may use any.
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")

_CREATE = {Kind.PUBLISHER: "create_publisher", Kind.SUBSCRIPTION: "create_subscription"}
_DOES = {Kind.PUBLISHER: "publishes on", Kind.SUBSCRIPTION: "subscribes to"}
_DOES_NOTHING = {Kind.PUBLISHER: "publishes nothing", Kind.SUBSCRIPTION: "subscribes to nothing"}
_OTHER = {Kind.PUBLISHER: Kind.SUBSCRIPTION, Kind.SUBSCRIPTION: Kind.PUBLISHER}


@dataclass(frozen=True)
class NoEndpoint(Symptom[Cause]):
    """A publisher or a subscription is missing."""

    recording: Recording
    kind: Kind
    topic: str

    @property
    def own(self) -> list[Endpoint]:
        """The student's endpoints of this kind, without those that every node has."""
        found = self.recording.student_endpoints(self.kind)
        return [item for item in found if item.topic not in OWN_TOPICS]

    @property
    def evidence(self) -> Evidence:
        """What there is instead."""
        moments = endpoints_seen(self.recording, self.own) or nodes_seen(self.recording)
        return Evidence(moments=moments, tables=_endpoints_table(self.recording))

    @property
    def create(self) -> str:
        """The call that creates such an endpoint."""
        return f"self.{_CREATE[self.kind]}(...)"


def why_no_endpoint(recording: Recording, kind: Kind, topic: str) -> Cause | None:
    """Why the student has no such endpoint on a topic, or None if there is one."""
    if recording.student_endpoints(kind, topic):
        return None
    if kind is Kind.PUBLISHER and _only_students_publish(recording, topic):
        return None
    return cause_of(NoEndpoint(recording, kind, topic))


@explanation(NoEndpoint)
def no_node(symptom: NoEndpoint) -> Cause | None:
    """There is no node at all."""
    return why_no_node(symptom.recording)


@explanation(NoEndpoint)
def misspelt_topic(symptom: NoEndpoint) -> Cause | None:
    """The topic's name is misspelt, private, in a namespace, or in other case."""
    ended, topic = crashed(symptom.recording), symptom.topic
    # What a process that lives has is no misspelling of what a dead one never came to create.
    suspects = [
        Named(item.topic, item.node)
        for item in symptom.own
        if not ended or declarations.process_of(symptom.recording, item.node) in (None, *ended)
    ]
    return why_misnamed(
        topic,
        suspects,
        f"the node {_DOES[symptom.kind]}",
        f"Write the topic's name as '{topic.rpartition('/')[2]}' in {symptom.create}.",
        symptom.evidence,
    )


@explanation(NoEndpoint)
def process_crashed(symptom: NoEndpoint) -> Cause | None:
    """The process ended with a failure before it created the endpoint."""
    ended = crashed(symptom.recording)
    return why_it_exited(symptom.recording, ended[0]) if ended else None


@explanation(NoEndpoint)
def never_appeared(symptom: NoEndpoint) -> Cause | None:
    """The process created the endpoint, but it never appeared in the ROS graph."""
    kind, topic = symptom.kind.value, symptom.topic
    if not declarations.declares(symptom.recording, kind, "topic", topic):
        return None
    return why_never_appeared(symptom.recording, f"a {kind} on {code(topic)}")


@explanation(NoEndpoint)
def exchanged_executables(symptom: NoEndpoint) -> Cause | None:
    """In setup.py an executable runs the function of another one."""
    exchanged = why_exchanged(symptom.recording)
    seen = f"there is no {symptom.kind.value} on {code(symptom.topic)}"
    return exchanged and exchanged.after(seen)


@explanation(NoEndpoint)
def publisher_and_subscription_exchanged(symptom: NoEndpoint) -> Cause | None:
    """The node publishes where it should subscribe, or subscribes where it should publish."""
    kind, other = symptom.kind, _OTHER[symptom.kind]
    if not symptom.recording.student_endpoints(other, symptom.topic):
        return None
    return Cause(
        f"the node {_DOES[other]} {code(symptom.topic)} instead: found a {other.value} there, "
        f"no {kind.value}",
        f"Use {symptom.create} where the node has self.{_CREATE[other]}(...).",
        symptom.evidence,
    )


@explanation(NoEndpoint)
def nothing_created(symptom: NoEndpoint) -> Cause | None:
    """The node has no publisher, or no subscription, at all."""
    if symptom.own:
        return None
    return Cause(
        f"the node {codes(node.name for node in symptom.recording.student_nodes)} "
        f"{_DOES_NOTHING[symptom.kind]} (/rosout and /parameter_events belong to every node)",
        f"Call {symptom.create} in the node's constructor.",
        symptom.evidence,
    )


@explanation(NoEndpoint)
def other_topic(symptom: NoEndpoint) -> Cause | None:
    """The right type of message is on a topic of another name."""
    wanted = {item.type for item in _probe_endpoints(symptom.recording, symptom.topic)}
    same = [item.topic for item in symptom.own if item.type in wanted]
    if not same:
        return None
    return Cause(
        f"the right type of message, but on another topic: the node {_DOES[symptom.kind]} "
        f"{codes(same)}",
        f"Write the topic's name as '{symptom.topic.lstrip('/')}' in {symptom.create}.",
        symptom.evidence,
    )


@explanation(NoEndpoint, general=True)
def others_only(symptom: NoEndpoint) -> Cause:
    """The node has other topics only."""
    return Cause(
        f"the node {_DOES[symptom.kind]} {codes(item.topic for item in symptom.own)} only",
        f"Call {symptom.create} with the topic '{symptom.topic.lstrip('/')}'.",
        symptom.evidence,
    )


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
