"""Services and actions that the student's nodes offer, and why one of them is not there."""

from __future__ import annotations

from dataclasses import dataclass

from grader.checks.finding import Evidence, Finding, Moment, Table
from grader.checks.first_seen import nodes_seen
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_destroyed
from grader.diagnosis.exchanged_executables import why_exchanged
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.near_name import Named, why_misnamed
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.process_exit import crashed, why_it_exited
from grader.recording.interaction import Service
from grader.recording.model import Recording

_SEND_GOAL = "/_action/send_goal"
_ACTION = "/_action/"
_OF_GOALS = "_SendGoal"
_MOST_ROWS = 50

# Every node has these by itself; they say nothing of what the student wrote.
_OWN = frozenset(
    {
        "describe_parameters",
        "get_parameter_types",
        "get_parameters",
        "get_type_description",
        "list_parameters",
        "set_parameters",
        "set_parameters_atomically",
    }
)


@dataclass(frozen=True)
class Word:
    """How a thing that is offered is called, and made.

    Attributes:
        noun: ``service`` or ``action``.
        create: The code that makes one; ``{type}`` and ``{name}`` stand for its own.
    """

    article: str
    noun: str
    create: str
    folder: str


SERVICE = Word("a", "service", "self.create_service({type}, '{name}', self.callback)", "srv")
ACTION = Word(
    "an", "action", "ActionServer(self, {type}, '{name}', self.execute_callback)", "action"
)


def services(recording: Recording) -> tuple[Service, ...]:
    """Services that the student wrote, without those that every node has."""
    return tuple(
        item
        for item in recording.services
        if _ACTION not in item.name and not _is_own(item.name, item.node)
    )


def actions(recording: Recording) -> tuple[Service, ...]:
    """Actions, each with its own name and type."""
    return tuple(
        Service(
            item.name.removesuffix(_SEND_GOAL),
            item.type.removesuffix(_OF_GOALS),
            item.node,
            item.appeared_ns,
            item.vanished_ns,
        )
        for item in recording.services
        if item.name.endswith(_SEND_GOAL)
    )


def offered(recording: Recording, word: Word, name: str) -> tuple[Service, ...]:
    """What the student's nodes offer under a name, parameter services too."""
    items = recording.services if word is SERVICE else actions(recording)
    return tuple(item for item in items if item.name == name)


def _is_own(name: str, node: str) -> bool:
    prefix, _, base = name.rpartition("/")
    return prefix == node and base in _OWN


def is_offered(recording: Recording, word: Word, name: str, interface: str | None) -> Finding:
    """The finding of a check that a node of the student offers a service or action.

    Args:
        interface: Its type, or None where any will do.
    """
    expected = f"{word.article} {word.noun} {code(name)}"
    expected += f" of {code(interface)}" if interface else ""
    cause = why_not_offered(recording, word, name, interface)
    if cause is not None:
        return cause.finding(expected)
    found = offered(recording, word, name)[0]
    when_s = recording.since_launch_s(found.appeared_ns)
    return Finding.passed(
        expected,
        f"{code(found.node)} offers it, with the type {code(found.type)}, seen {when_s:.2f} s "
        "after launch",
        Evidence(moments=(Moment(f"{word.noun} {found.name} appeared", when_s),)),
    )


def _of_students(recording: Recording, word: Word) -> tuple[Service, ...]:
    return services(recording) if word is SERVICE else actions(recording)


@dataclass(frozen=True)
class NotOffered(Symptom[Cause]):
    """A service or an action is missing.

    Attributes:
        interface: Its type, or None where any will do.
    """

    recording: Recording
    word: Word
    name: str
    interface: str | None

    @property
    def there(self) -> tuple[Service, ...]:
        """What the student's nodes offer of the kind."""
        return _of_students(self.recording, self.word)

    @property
    def evidence(self) -> Evidence:
        """The same as a table."""
        return _evidence(self.recording, self.there, self.word)

    @property
    def create(self) -> str:
        """The code that creates it."""
        return _create(self.word, self.name, self.interface)


def why_not_offered(
    recording: Recording, word: Word, name: str, interface: str | None = None
) -> Cause | None:
    """Why no node of the student offers a service or action, or None if one does."""
    symptom = NotOffered(recording, word, name, interface)
    if any(one.name == name and interface in (None, one.type) for one in symptom.there):
        return None
    return cause_of(symptom)


@explanation(NotOffered)
def no_node(symptom: NotOffered) -> Cause | None:
    """There is no node at all."""
    return why_no_node(symptom.recording)


@explanation(NotOffered)
def other_type(symptom: NotOffered) -> Cause | None:
    """The service or action has another type."""
    own = next((one for one in symptom.there if one.name == symptom.name), None)
    if own is None or symptom.interface is None:
        return None
    package, _, short = symptom.interface.split("/")
    return Cause(
        f"the {symptom.word.noun} {code(own.name)} has the type {code(own.type)}",
        f"A client and a server meet only if their types are the same: "
        f"`from {package}.{symptom.word.folder} import {short}`.",
        symptom.evidence,
    )


@explanation(NotOffered)
def misspelt_name(symptom: NotOffered) -> Cause | None:
    """Its name is misspelt, private, in a namespace, or in other case."""
    return why_misnamed(
        symptom.name,
        [Named(item.name, item.node) for item in symptom.there],
        f"found the {symptom.word.noun}",
        f"Write its name as '{symptom.name.rpartition('/')[2]}'.",
        symptom.evidence,
    )


@explanation(NotOffered)
def process_crashed(symptom: NotOffered) -> Cause | None:
    """The process ended with a failure before it created the server."""
    ended = crashed(symptom.recording)
    return why_it_exited(symptom.recording, ended[0]) if ended else None


@explanation(NotOffered)
def service_and_action_exchanged(symptom: NotOffered) -> Cause | None:
    """A service was created where an action is expected, or the other way round."""
    wrong = ACTION if symptom.word is SERVICE else SERVICE
    if not any(item.name == symptom.name for item in _of_students(symptom.recording, wrong)):
        return None
    return Cause(
        f"{code(symptom.name)} is there, but as {wrong.article} {wrong.noun}",
        f"Make it with {symptom.create}.",
        symptom.evidence,
    )


@explanation(NotOffered)
def exchanged_executables(symptom: NotOffered) -> Cause | None:
    """In setup.py an executable runs the function of another one."""
    exchanged = why_exchanged(symptom.recording)
    return exchanged and exchanged.after(f"there is no {symptom.word.noun} {code(symptom.name)}")


@explanation(NotOffered, general=True)
def nothing_offered(symptom: NotOffered) -> Cause:
    """The node offers others only, or none."""
    nodes = codes(item.name for item in symptom.recording.student_nodes)
    there = codes(item.name for item in symptom.there)
    noun = symptom.word.noun
    return Cause(
        f"{nodes} offers {there} only" if symptom.there else f"{nodes} offers no {noun}",
        f"Call {symptom.create} in the node's constructor.",
        symptom.evidence,
    )


def why_not_met(recording: Recording, word: Word, name: str, what: str, asked_ns: int) -> Cause:
    """Why something that was offered could not be asked."""
    items = offered(recording, word, name)
    return why_destroyed(recording, f"it {what}", f"the {word.noun} {code(name)}", items) or Cause(
        f"the {word.noun} {code(name)} {what}: it was there, but no client with the usual QoS met "
        "it",
        f"Keep the {word.noun} and its node as long as the program runs, and leave its QoS as it "
        "is.",
        Evidence(moments=(Moment("given up", recording.since_launch_s(asked_ns)),)),
    )


def _create(word: Word, name: str, interface: str | None) -> str:
    short = interface.rpartition("/")[2] if interface else "Type"
    return code(word.create.format(type=short, name=name.lstrip("/")))


def _evidence(recording: Recording, there: tuple[Service, ...], word: Word) -> Evidence:
    rows = tuple((item.node, item.name, item.type) for item in there[:_MOST_ROWS])
    table = Table(
        f"{word.noun.capitalize()}s of the student's nodes", ("node", "name", "type"), rows
    )
    return Evidence(
        moments=tuple(
            Moment(f"{word.noun} {item.name} appeared", recording.since_launch_s(item.appeared_ns))
            for item in there[:5]
        )
        or nodes_seen(recording),
        tables=(table,) if rows else (),
    )
