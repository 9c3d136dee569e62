"""Publishers, subscriptions, services and actions of the student, and why one is not there."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

from grader.diagnosis.destroyed_endpoint import why_dropped
from grader.diagnosis.explanation import cause_of, explanation, mistaken
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.process_exit import NotDone, process_ended
from grader.diagnosis.undeclared import why_never_appeared
from grader.findings.finding import Evidence, Finding, Table, evidence_at, nodes_seen
from grader.findings.words import code, codes, type_in_code, worded
from grader.measure import declarations
from grader.recording.interaction import Service
from grader.recording.model import Kind, Owner, Recording
from grader.spec.name import TOPIC
from grader.spec.nearest_name import nearest

# Every rclpy node has these by itself; they say nothing of what the student wrote.
OWN_TOPICS = frozenset({"/rosout", "/parameter_events", "/clock"})
_OWN_SERVICE = re.compile(
    r"(describe|get|list|set)_parameters|set_parameters_atomically|get_parameter_types"
    r"|get_type_description"
)
_SEND_GOAL = "/_action/send_goal"
_MOST_ROWS = 50
_FUNCTION = re.compile(r"(\w+)(?:<\{full\}>)?\(")
# The name becomes an argument, and a DDS participant that is not of ROS may use any.
_NAME = re.compile(TOPIC)


class Entity(NamedTuple):
    """One publisher, subscription, server or client that a node of the student has."""

    node: str
    name: str
    type: str


@dataclass(frozen=True)
class EntityKind:
    """What a node can have in the ROS graph: how one is called, made and found.

    Attributes:
        does: What a node does that has one, before its name.
        python: The code that makes one; ``{type}`` and ``{name}`` stand for its own.
        cpp: The same, with ``{full}``: the type with its package.
        entities: The student's in a recording, without what every node has.
        endpoint: The kind of endpoint that it is on a topic, if it is one.
    """

    noun: str
    does: str
    python: str
    cpp: str
    entities: Callable[[Recording], list[Entity]]
    endpoint: Kind | None = None

    @property
    def functions(self) -> frozenset[str]:
        """The functions of rclpy and rclcpp that make one."""
        return frozenset(_FUNCTION.findall(f"{self.python} {self.cpp}"))


def _on_topics(kind: Kind, recording: Recording) -> list[Entity]:
    ends = recording.student_endpoints(kind)
    return [Entity(end.node, end.topic, end.type) for end in ends if end.topic not in OWN_TOPICS]


def _entities(services: Iterable[Service]) -> list[Entity]:
    return [Entity(one.node, one.name, one.type) for one in services if not _is_own(one)]


def _is_own(service: Service) -> bool:
    """Whether every node has such a service by itself, or an action brings it along."""
    prefix, _, base = service.name.rpartition("/")
    of_node = prefix == service.node and _OWN_SERVICE.fullmatch(base) is not None
    return of_node or "/_action/" in service.name


def _actions(services: Iterable[Service]) -> Iterable[Service]:
    """The services that take goals, with the names and types of their actions."""
    for service in services:
        if service.name.endswith(_SEND_GOAL):
            name, type_ = service.name.removesuffix(_SEND_GOAL), service.type
            yield replace(service, name=name, type=type_.removesuffix("_SendGoal"))


PUBLISHER = EntityKind(
    "publisher",
    "publishes on",
    python="self.create_publisher({type}, '{name}', 10)",
    cpp='this->create_publisher<{full}>("{name}", 10)',
    entities=partial(_on_topics, Kind.PUBLISHER),
    endpoint=Kind.PUBLISHER,
)
SUBSCRIPTION = EntityKind(
    "subscription",
    "subscribes to",
    python="self.create_subscription({type}, '{name}', self.callback, 10)",
    cpp='this->create_subscription<{full}>("{name}", 10, callback)',
    entities=partial(_on_topics, Kind.SUBSCRIPTION),
    endpoint=Kind.SUBSCRIPTION,
)
SERVICE = EntityKind(
    "service",
    "offers the service",
    python="self.create_service({type}, '{name}', self.callback)",
    cpp='this->create_service<{full}>("{name}", callback)',
    entities=lambda recording: _entities(recording.services),
)
ACTION = EntityKind(
    "action",
    "offers the action",
    python="ActionServer(self, {type}, '{name}', self.execute_callback)",
    cpp='rclcpp_action::create_server<{full}>(this, "{name}", handle_goal, '
    "handle_cancel, handle_accepted)",
    entities=lambda recording: _entities(_actions(recording.services)),
)
CLIENT = EntityKind(
    "client",
    "has a client of",
    python="self.create_client({type}, '{name}')",
    cpp='this->create_client<{full}>("{name}")',
    entities=lambda recording: _entities(recording.clients),
)
ACTION_CLIENT = EntityKind(
    "action client",
    "has an action client of",
    python="ActionClient(self, {type}, '{name}')",
    cpp='rclcpp_action::create_client<{full}>(this, "{name}")',
    entities=lambda recording: _entities(_actions(recording.clients)),
)
_KINDS = (PUBLISHER, SUBSCRIPTION, SERVICE, ACTION, CLIENT, ACTION_CLIENT)
ENDPOINTS = {Kind.PUBLISHER: PUBLISHER, Kind.SUBSCRIPTION: SUBSCRIPTION}
"""What is on topics, by its kind of endpoint."""


@dataclass(frozen=True)
class NoEndpoint(NotDone, concept="names"):
    """A publisher, a subscription, a service, an action, or a client of one is missing.

    Attributes:
        types: Any of which it may have; empty where any will do.
    """

    kind: EntityKind
    name: str
    types: tuple[str, ...] = ()
    only_failures = True

    @property
    def entities(self) -> list[Entity]:
        """What the student's nodes have of this kind, under any name."""
        return self.kind.entities(self.recording)

    @property
    def evidence(self) -> Evidence:
        """What there is instead."""
        rows = [
            (item.node, kind.noun, item.name, item.type)
            for kind in _KINDS
            for item in kind.entities(self.recording)
        ]
        header = ("node", "kind", "name", "type")
        table = Table("What the student's nodes have", header, tuple(rows[:_MOST_ROWS]))
        return Evidence(moments=nodes_seen(self.recording), tables=(table,) if rows else ())

    @property
    def create(self) -> str:
        """The code that creates it."""
        parts = self.types[0].split("/") if self.types else ["Type"]
        template = worded(self.kind.python, self.kind.cpp)
        name = self.name.lstrip("/")
        return code(template.format(type=parts[-1], full="::".join(parts), name=name))


def offered(recording: Recording, kind: EntityKind, name: str) -> tuple[Service, ...]:
    """The servers that the student's nodes have under a name, parameter services too."""
    services = _actions(recording.services) if kind is ACTION else recording.services
    return tuple(item for item in services if item.name == name)


def why_no_endpoint(recording: Recording, kind: Kind, topic: str) -> Finding | None:
    """Why the student has no such endpoint on a topic, or None if there is one."""
    if recording.student_endpoints(kind, topic):
        return None
    others = [end for end in recording.endpoints if end.topic == topic]
    has_other_publisher = any(
        end.owner is not Owner.STUDENT and end.kind is Kind.PUBLISHER for end in others
    )
    # Messages came that only the student can have published.
    if kind is Kind.PUBLISHER and recording.on(topic) and not has_other_publisher:
        return None
    types = tuple(sorted({end.type for end in others if end.owner is Owner.PROBE}))
    return cause_of(NoEndpoint(recording, ENDPOINTS[kind], topic, types))


def why_not_offered(
    recording: Recording, kind: EntityKind, name: str, interface: str | None = None
) -> Finding | None:
    """Why no node of the student offers a service or action, or None if one does."""
    symptom = NoEndpoint(recording, kind, name, (interface,) if interface else ())
    if any(one.name == name and interface in (None, one.type) for one in symptom.entities):
        return None
    return cause_of(symptom)


def why_not_met(recording: Recording, kind: EntityKind, name: str, asked_ns: int) -> Finding:
    """Why something that was offered could not be asked."""
    return mistaken(
        "not_met",
        f"the {kind.noun} {code(name)} could not be asked: it was there, but went away, or did not "
        "match a client with the default QoS",
        evidence_at(recording, "rosgrade gave up", asked_ns),
        noun=kind.noun,
    )


def meant_endpoint(
    recording: Recording, kind: EntityKind, name: str, type_: str | None = None
) -> str | None:
    """The wrong name that the student probably gave: of the only one that has the right type.

    Args:
        type_: The right type; by default what the probe has or asks under the name.
    """
    if kind is SERVICE:
        asked = [(call.service, call.type) for call in recording.calls]
    elif kind is ACTION:
        asked = [(goal.action, goal.type) for goal in recording.goals]
    else:
        ends = (end for end in recording.endpoints if end.owner is not Owner.STUDENT)
        asked = [(end.topic, end.type) for end in ends]
    right_types = {type_} if type_ else {type for other, type in asked if other == name}
    right_names = dict(asked)
    candidates = {
        item.name
        for item in kind.entities(recording)
        if item.type in right_types and item.name not in right_names and _NAME.fullmatch(item.name)
    }
    return candidates.pop() if len(candidates) == 1 else None


@explanation(NoEndpoint)
def no_node(symptom: NoEndpoint) -> Finding | None:
    """There is no node at all."""
    return why_no_node(symptom.recording)


@explanation(NoEndpoint, concept="interfaces")
def other_interface(symptom: NoEndpoint) -> Finding | None:
    """The service or action has another type."""
    same = [item for item in symptom.entities if item.name == symptom.name]
    if not same or not symptom.types:
        return None
    return mistaken(
        "other_interface",
        f"the {symptom.kind.noun} {code(symptom.name)} has the type {code(same[0].type)}",
        symptom.evidence,
        type=code(type_in_code(symptom.types[0])),
    )


@explanation(NoEndpoint, before=(process_ended,))
def misspelt_name(symptom: NoEndpoint) -> Finding | None:
    """Its name is misspelt, private, in a namespace, or in wrong upper or lower case."""
    ended = symptom.ended
    # What a process that lives has is no misspelling of what another never came to create.
    names = [
        item.name
        for item in symptom.entities
        if not ended or declarations.process_of(symptom.recording, item.node) in (None, *ended)
    ]
    resemblance = _resemblance(symptom.name, names)
    if resemblance is None:
        return None
    match, mistake, difference = resemblance
    seen = f"the node {symptom.kind.does} {code(match)} instead of {code(symptom.name)}"
    return mistaken(mistake, seen + difference, symptom.evidence, create=symptom.create)


def _resemblance(wanted: str, names: Sequence[str]) -> tuple[str, str, str] | None:
    """The name that is likest to the wanted one, which mistake that is, and how they differ."""
    for name in reversed(names):
        if name.lower() == wanted.lower():
            return name, "misspelt_name", ": upper and lower case differ"
        if name.endswith(wanted):
            prefix = name.removesuffix(wanted)
            return name, "prefixed_name", f": {code(prefix)} stands in front of the name"
    match = nearest(wanted, names)
    return (match, "misspelt_name", "") if match else None


@explanation(NoEndpoint, after=(process_ended,))
def dropped(symptom: NoEndpoint) -> Finding | None:
    """It ended with the constructor or the callback that created it."""
    if symptom.kind.endpoint is None:
        return None
    return why_dropped(symptom.recording, symptom.kind.endpoint, symptom.name)


@explanation(NoEndpoint)
def never_appeared(symptom: NoEndpoint) -> Finding | None:
    """The process created it, but it never appeared in the ROS graph."""
    noun, name = symptom.kind.noun, symptom.name
    if not declarations.declares(symptom.recording, noun, topic=name):
        return None
    return why_never_appeared(symptom.recording, f"a {noun} on {code(name)}")


@explanation(NoEndpoint, general=True)
def others_only(symptom: NoEndpoint) -> Finding:
    """The node has only others, perhaps of the right type, or none."""
    noun, entities = symptom.kind.noun, symptom.entities
    created = f"created no {noun}"
    if entities:
        created = f"created {noun}s only for {codes(item.name for item in entities)}"
    observed = f"{codes(node.name for node in symptom.recording.student_nodes)} {created}"
    right_type = codes(item.name for item in entities if item.type in symptom.types)
    if right_type:
        observed += f"; the type is right on {right_type}"
    return mistaken("others_only", observed, symptom.evidence, create=symptom.create)
