"""Publishers, subscriptions, services and actions of the student, and why one is not there."""

from __future__ import annotations

import re
from dataclasses import dataclass

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


@dataclass(frozen=True)
class Word:
    """How an endpoint, a server or a client is called, and made.

    Attributes:
        does: What a node does that has one, before its name.
        python: The code that makes one; ``{type}`` and ``{name}`` stand for its own.
        cpp: The same, with ``{full}``: the type with its package.
    """

    noun: str
    does: str
    python: str
    cpp: str

    @property
    def functions(self) -> frozenset[str]:
        """The functions of rclpy and rclcpp that make one."""
        return frozenset(_FUNCTION.findall(f"{self.python} {self.cpp}"))


PUBLISHER = Word(
    "publisher",
    "publishes on",
    python="self.create_publisher({type}, '{name}', 10)",
    cpp='this->create_publisher<{full}>("{name}", 10)',
)
SUBSCRIPTION = Word(
    "subscription",
    "subscribes to",
    python="self.create_subscription({type}, '{name}', self.callback, 10)",
    cpp='this->create_subscription<{full}>("{name}", 10, callback)',
)
SERVICE = Word(
    "service",
    "offers the service",
    python="self.create_service({type}, '{name}', self.callback)",
    cpp='this->create_service<{full}>("{name}", callback)',
)
ACTION = Word(
    "action",
    "offers the action",
    python="ActionServer(self, {type}, '{name}', self.execute_callback)",
    cpp='rclcpp_action::create_server<{full}>(this, "{name}", handle_goal, '
    "handle_cancel, handle_accepted)",
)
CLIENT = Word(
    "client",
    "has a client of",
    python="self.create_client({type}, '{name}')",
    cpp='this->create_client<{full}>("{name}")',
)
ACTION_CLIENT = Word(
    "action client",
    "has an action client of",
    python="ActionClient(self, {type}, '{name}')",
    cpp='rclcpp_action::create_client<{full}>(this, "{name}")',
)
_WORDS = (PUBLISHER, SUBSCRIPTION, SERVICE, ACTION, CLIENT, ACTION_CLIENT)
ENDPOINTS = {Kind.PUBLISHER: PUBLISHER, Kind.SUBSCRIPTION: SUBSCRIPTION}
"""The word for each kind of endpoint."""


@dataclass(frozen=True)
class NoEndpoint(NotDone, concept="names"):
    """A publisher, a subscription, a service, an action, or a client of one is missing.

    Attributes:
        types: Any of which it may have; empty where any will do.
    """

    word: Word
    name: str
    types: tuple[str, ...] = ()
    only_failures = True

    @property
    def there(self) -> tuple[Service, ...]:
        """What the student's nodes have of this kind, without what every node has."""
        return _of_students(self.recording, self.word)

    @property
    def evidence(self) -> Evidence:
        """What there is instead."""
        rows = [
            (item.node, word.noun, item.name, item.type)
            for word in _WORDS
            for item in _of_students(self.recording, word)
        ]
        header = ("node", "kind", "name", "type")
        table = Table("What the student's nodes have", header, tuple(rows[:_MOST_ROWS]))
        return Evidence(moments=nodes_seen(self.recording), tables=(table,) if rows else ())

    @property
    def create(self) -> str:
        """The code that creates it."""
        names = self.types[0].split("/") if self.types else ["Type"]
        full, name = "::".join(names), self.name.lstrip("/")
        return code(
            worded(self.word.python, self.word.cpp).format(type=names[-1], full=full, name=name)
        )


def offered(recording: Recording, word: Word, name: str) -> tuple[Service, ...]:
    """What the student's nodes have under a name, parameter services too."""
    items = recording.services if word is SERVICE else _of_students(recording, word)
    return tuple(item for item in items if item.name == name)


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
    recording: Recording, word: Word, name: str, interface: str | None = None
) -> Finding | None:
    """Why no node of the student offers a service or action, or None if one does."""
    symptom = NoEndpoint(recording, word, name, (interface,) if interface else ())
    if any(one.name == name and interface in (None, one.type) for one in symptom.there):
        return None
    return cause_of(symptom)


def why_not_met(recording: Recording, word: Word, name: str, asked_ns: int) -> Finding:
    """Why something that was offered could not be asked."""
    return mistaken(
        "not_met",
        f"the {word.noun} {code(name)} could not be asked: it was there, but went away, or did not "
        "match a client with the default QoS",
        evidence_at(recording, "rosgrade gave up", asked_ns),
        noun=word.noun,
    )


def meant_endpoint(
    recording: Recording, word: Word, name: str, type_: str | None = None
) -> str | None:
    """The wrong name that the student probably gave: of the only one that has the right type.

    Args:
        type_: The right type; by default what the probe has or asks under the name.
    """
    if word is SERVICE:
        asked = [(call.service, call.type) for call in recording.calls]
    elif word is ACTION:
        asked = [(goal.action, goal.type) for goal in recording.goals]
    else:
        ends = (end for end in recording.endpoints if end.owner is not Owner.STUDENT)
        asked = [(end.topic, end.type) for end in ends]
    right_types = {type_} if type_ else {type for other, type in asked if other == name}
    right_names = dict(asked)
    candidates = {
        item.name
        for item in _of_students(recording, word)
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
    same = [item for item in symptom.there if item.name == symptom.name]
    if not same or not symptom.types:
        return None
    return mistaken(
        "other_interface",
        f"the {symptom.word.noun} {code(symptom.name)} has the type {code(same[0].type)}",
        symptom.evidence,
        type=code(type_in_code(symptom.types[0])),
    )


@explanation(NoEndpoint, before=(process_ended,))
def misspelt_name(symptom: NoEndpoint) -> Finding | None:
    """Its name is misspelt, private, in a namespace, or in wrong upper or lower case."""
    ended, wanted = symptom.ended, symptom.name
    # What a process that lives has is no misspelling of what another never came to create.
    names = [
        item.name
        for item in symptom.there
        if not ended or declarations.process_of(symptom.recording, item.node) in (None, *ended)
    ]
    match = nearest(wanted, names)
    mistake, why = "misspelt_name", ""
    for name in names:
        if name.lower() == wanted.lower():
            match, why = name, ": upper and lower case differ"
        elif name.endswith(wanted):
            match, why = name, f": {code(name.removesuffix(wanted))} stands in front of the name"
            mistake = "prefixed_name"
    if match is None:
        return None
    seen = f"the node {symptom.word.does} {code(match)} instead of {code(wanted)}{why}"
    return mistaken(mistake, seen, symptom.evidence, create=symptom.create)


@explanation(NoEndpoint, after=(process_ended,))
def dropped(symptom: NoEndpoint) -> Finding | None:
    """It ended with the constructor or the callback that created it."""
    for kind, word in ENDPOINTS.items():
        if word is symptom.word:
            return why_dropped(symptom.recording, kind, symptom.name)
    return None


@explanation(NoEndpoint)
def never_appeared(symptom: NoEndpoint) -> Finding | None:
    """The process created it, but it never appeared in the ROS graph."""
    noun, name = symptom.word.noun, symptom.name
    if not declarations.declares(symptom.recording, noun, topic=name):
        return None
    return why_never_appeared(symptom.recording, f"a {noun} on {code(name)}")


@explanation(NoEndpoint, general=True)
def others_only(symptom: NoEndpoint) -> Finding:
    """The node has only others, perhaps of the right type, or none."""
    word, nodes = symptom.word, codes(node.name for node in symptom.recording.student_nodes)
    there = codes(item.name for item in symptom.there)
    same = codes(item.name for item in symptom.there if item.type in symptom.types)
    has = f"created {word.noun}s only for {there}" if there else f"created no {word.noun}"
    return mistaken(
        "others_only",
        f"{nodes} {has}" + (f"; the type is right on {same}" if same else ""),
        symptom.evidence,
        create=symptom.create,
    )


def _of_students(recording: Recording, word: Word) -> tuple[Service, ...]:
    of_clients = word in (CLIENT, ACTION_CLIENT)
    services = recording.clients if of_clients else recording.services
    if word in (SERVICE, CLIENT):
        return tuple(item for item in services if not _is_own(item))
    if word in (ACTION, ACTION_CLIENT):
        goals = (item for item in services if item.name.endswith(_SEND_GOAL))
        return tuple(_action(item) for item in goals)
    return tuple(
        Service(item.topic, item.type, item.node, item.appeared_ns, item.vanished_ns)
        for item in recording.student_endpoints(Kind(word.noun))
        if item.topic not in OWN_TOPICS
    )


def _is_own(service: Service) -> bool:
    """Whether every node has such a service by itself, or an action brings it along."""
    prefix, _, base = service.name.rpartition("/")
    of_node = prefix == service.node and _OWN_SERVICE.fullmatch(base) is not None
    return of_node or "/_action/" in service.name


def _action(service: Service) -> Service:
    """The action, with its own name and type, by the service that takes its goals."""
    name, type_ = service.name.removesuffix(_SEND_GOAL), service.type.removesuffix("_SendGoal")
    return Service(name, type_, service.node, service.appeared_ns, service.vanished_ns)
