"""Services and actions that the student's nodes offer, and why one of them is not there."""

from __future__ import annotations

from dataclasses import dataclass

from grader.checks.finding import Evidence, Finding, Moment, Table
from grader.checks.first_seen import nodes_seen
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_destroyed
from grader.diagnosis.exchanged_executables import why_exchanged
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


def why_not_offered(
    recording: Recording, word: Word, name: str, interface: str | None = None
) -> Cause | None:
    """Why no node of the student offers a service or action, or None if one does.

    Args:
        interface: Its type, or None where any will do.
    """
    there = _of_students(recording, word)
    own = [item for item in there if item.name == name]
    if any(interface in (None, item.type) for item in own):
        return None
    cause = why_no_node(recording)
    if cause is not None:
        return cause
    evidence = _evidence(recording, there, word)
    if own and interface is not None:
        return _other_type(own[0], word, interface, evidence)
    near = why_misnamed(
        name,
        [Named(item.name, item.node) for item in there],
        f"found the {word.noun}",
        f"Write its name as '{name.rpartition('/')[2]}'.",
        evidence,
    )
    if near is not None:
        return near
    ended = crashed(recording)
    if ended:
        return why_it_exited(recording, ended[0])
    wrong = ACTION if word is SERVICE else SERVICE
    if any(item.name == name for item in _of_students(recording, wrong)):
        return Cause(
            f"{code(name)} is there, but as {wrong.article} {wrong.noun}",
            f"Make it with {_create(word, name, interface)}.",
            evidence,
        )
    exchanged = why_exchanged(recording)
    if exchanged is not None:
        return exchanged.after(f"there is no {word.noun} {code(name)}")
    nodes = codes(item.name for item in recording.student_nodes)
    there_words = codes(item.name for item in there)
    return Cause(
        f"{nodes} offers {there_words} only" if there else f"{nodes} offers no {word.noun}",
        f"Call {_create(word, name, interface)} in the node's constructor.",
        evidence,
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


def _other_type(item: Service, word: Word, interface: str, evidence: Evidence) -> Cause:
    package, _, short = interface.split("/")
    return Cause(
        f"the {word.noun} {code(item.name)} has the type {code(item.type)}",
        f"A client and a server meet only if their types are the same: "
        f"`from {package}.{word.folder} import {short}`.",
        evidence,
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
