"""Why a node's parameter is not declared, or its parameter services were not asked."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from grader.diagnosis.explanation import Symptom, cause_of, explanation, mistaken
from grader.diagnosis.no_answer import NoAnswer, why_late
from grader.diagnosis.no_endpoint import SERVICE
from grader.diagnosis.no_node import why_not_node
from grader.diagnosis.process.not_called import ANSWER_S
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.finding import Evidence, Finding, Moment, evidence_at, moment, nodes_seen
from grader.findings.words import code, codes, worded
from grader.measure.parameter_calls import calls_to, descriptor, undeclared
from grader.measure.parameter_calls import names as declared
from grader.recording.interaction import NO_SERVER
from grader.recording.model import Call, Recording
from grader.recording.submission import SourceError
from grader.spec.nearest_name import nearest

_LAUNCH_FILES = (".py", ".xml", ".yaml", ".yml")
_WILD = {"*": "[^/]+", "**": ".+"}


def declare_parameter(name: str, default: str = "default") -> str:
    """The code that declares a parameter."""
    return worded(
        python=f"self.declare_parameter('{name}', {default})",
        cpp=f'this->declare_parameter("{name}", {default})',
    )


def get_parameter(name: str) -> str:
    """The code that reads a parameter."""
    return worded(
        python=f"self.get_parameter('{name}').value",
        cpp=f'this->get_parameter("{name}").get_value<...>()',
    )


@dataclass(frozen=True)
class NotDeclared(Symptom[Finding]):
    """A parameter is not declared."""

    recording: Recording
    node: str
    name: str

    @property
    def there(self) -> list[str]:
        """Parameters that the node declares."""
        return declared(self.recording, self.node)

    @property
    def asked(self) -> tuple[Call, ...]:
        """Calls that ask which parameters there are."""
        return calls_to(self.recording, self.node, "list_parameters", "describe_parameters")

    def cause(self, seen: str) -> Finding:
        """The cause for what is declared instead."""
        shown = Evidence(moments=answered_at(self.recording, self.asked))
        return mistaken("not_declared_here", seen, shown, declare=declare_parameter(self.name))


def why_not_declared(recording: Recording, node: str, name: str) -> Finding | None:
    """Why a node does not declare a parameter, or None if it does."""
    symptom = NotDeclared(recording, node, name)
    cause = why_not_node(recording, node) or why_services_silent(recording, symptom.asked)
    if cause is not None:
        return cause
    declaration = descriptor(recording, node, name)
    is_declared = declaration is not None and declaration.type != "not set"
    return None if is_declared else cause_of(symptom)


@explanation(NotDeclared)
def services_not_asked(symptom: NotDeclared) -> Finding | None:
    """The process ended, or a callback blocked the node, before the probe could ask."""
    found = descriptor(symptom.recording, symptom.node, symptom.name)
    if symptom.asked and (found is not None or symptom.name not in symptom.there):
        return None
    return why_not_asked(symptom.recording, symptom.node, "its descriptor was not read")


@explanation(NotDeclared, general=True)
def other_parameters(symptom: NotDeclared) -> Finding:
    """Its name is misspelt, it has no value, or only other parameters are declared, or none."""
    if not symptom.there:
        return symptom.cause("the node declares no parameters")
    if symptom.name in symptom.there:
        return symptom.cause(f"{code(symptom.name)} is declared, but without a value")
    match = nearest(symptom.name, symptom.there)
    if match is not None:
        return symptom.cause(f"declared is {code(match)}")
    return symptom.cause(f"declared are {codes(symptom.there)}")


def why_not_taken(recording: Recording, names: Iterable[str]) -> Finding | None:
    """Which of some parameters the launch gives and no node takes, or None if there is none."""
    lacking = [name for name in undeclared(recording) if name in names]
    if not lacking:
        return why_for_no_node(recording)
    answered = [call for call in recording.calls if call.service.endswith("/list_parameters")]
    nodes = recording.student_nodes
    there = sorted({name for node in nodes for name in declared(recording, node.name)})
    them = "it" if len(lacking) == 1 else "them"
    others = f"; declared {'is' if len(there) == 1 else 'are'} {codes(there)}" if there else ""
    return mistaken(
        "not_taken",
        f"the launch gives {codes(lacking)}, but no node declares {them}{others}",
        Evidence(moments=answered_at(recording, answered)),
        declare=declare_parameter(lacking[0]),
        get=get_parameter(lacking[0]),
    )


def why_for_no_node(recording: Recording) -> Finding | None:
    """The parameter file of a launch that is for a node of nearly the right name, or None.

    Only where a node has values from no file.
    """
    submission = recording.submission
    programs = {name for package in submission.packages for name in package.executables}
    launched = {process.name.rpartition("/")[2] for process in recording.processes} - programs
    if not any(name.endswith(_LAUNCH_FILES) for name in launched):
        return None
    nodes = [node.name for node in recording.written_nodes]
    entries = [(file.path, *entry) for file in submission.parameter_files for entry in file.nodes]
    lacking = {
        node.rpartition("/")[2]: node
        for node in nodes
        if not any(_addresses(key, node) for _, key, _ in entries)
    }
    for path, key, line in entries:
        base = key.rpartition("/")[2]
        like = nearest(base, lacking)
        # What is for quite another name may be right: for a program that does not run here.
        if like is None or any(_addresses(key, node) for node in nodes):
            continue
        right = lacking[like]
        place = SourceError(path, line, f"its values are for {key}")
        return mistaken(
            "for_no_node",
            f"{code(path)} gives values to {code(key)}, and there is no such node: found "
            f"{codes(nodes)}",
            Evidence(nodes_seen(recording), (place,)),
            right=code(right),
            any=code("/**"),
        )
    return None


def _addresses(key: str, node: str) -> bool:
    """Whether a name in a parameter file, with its wildcards, is that of a node."""
    steps = (_WILD.get(step, re.escape(step)) for step in key.strip("/").split("/"))
    return re.fullmatch("/".join(steps), node.strip("/")) is not None


def why_services_silent(recording: Recording, calls: Iterable[Call]) -> Finding | None:
    """Why one of some calls to a node's parameter services has no answer, or None."""
    lost = next((call for call in calls if call.answered_ns is None), None)
    if lost is None:
        return None
    server, asked_ns = lost.service, lost.requested_ns
    service = code(server.rpartition("/")[2])
    if not lost.error:
        what = f"the node's parameter service {service} did not answer"
        return cause_of(NoAnswer(recording, what, SERVICE, server, asked_ns, ANSWER_S))
    if lost.error != NO_SERVER:
        return Finding.ours(f"{service} could not be asked: {lost.error}")
    return mistaken(
        "no_parameter_services",
        f"the node has no service {service}",
        evidence_at(recording, "asked", asked_ns),
    )


def why_not_asked(recording: Recording, node: str, what: str) -> Finding:
    """Why the probe asked a node's parameter services no more: an answer was late or lost."""
    cause = why_ended(recording) or _why_last_call_late(recording, node)
    return cause.after(what) if cause is not None else Finding.undecided(f"{what} by the probe")


def _why_last_call_late(recording: Recording, node: str) -> Finding | None:
    """Why the last call to a node's parameter services was answered late or not at all, or None."""
    calls = [
        call
        for call in recording.calls
        if call.service.rpartition("/")[0] == node and call.request and not call.error
    ]
    if not calls:
        return None
    server, asked_ns = calls[-1].service, calls[-1].requested_ns
    seen = f"the node's parameter service {code(server.rpartition('/')[2])} did not answer"
    silence = NoAnswer(recording, seen, SERVICE, server, asked_ns, ANSWER_S)
    shown = evidence_at(recording, "asked", asked_ns)
    return why_late(silence, calls[-1].answered_ns, "slow_node", shown)


def answered_at(recording: Recording, calls: Iterable[Call]) -> tuple[Moment, ...]:
    """When the first of some calls was answered."""
    moments = [
        moment(recording, f"{call.service.rpartition('/')[2]} was answered", call.answered_ns)
        for call in calls
        if call.answered_ns is not None
    ]
    return tuple(moments[:1])
