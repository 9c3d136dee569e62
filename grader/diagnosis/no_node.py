"""Why no node of the student appeared: nothing launched, crashed, hangs, or has another name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from grader.diagnosis.explanation import cause_of, explanation, mistaken
from grader.diagnosis.not_built import why_not_built
from grader.diagnosis.process.not_called import at_its_place
from grader.diagnosis.process.process_exit import NotDone, ended_early, process_ended
from grader.diagnosis.process.standing import where_it_stands
from grader.diagnosis.undeclared import why_never_appeared
from grader.findings.finding import Evidence, Finding, nodes_seen, until_the_end
from grader.findings.words import INIT, code, codes
from grader.measure import declarations
from grader.recording.interaction import EXECUTOR_SERVICES
from grader.recording.model import OF_ROS, Ending, Process, Recording
from grader.spec.name import TOPIC
from grader.spec.nearest_name import meant, nearest

_LOG_LINES = 10
# The name becomes an argument.
_NAME = re.compile(TOPIC)
# How the cell calls the wait for a process that it could not start.
_START = "start of "


@dataclass(frozen=True)
class NoNode(NotDone, concept="nodes"):
    """No node of the student appeared."""

    @property
    def is_launched(self) -> bool:
        """Whether a process was started."""
        return self.recording.ending is not Ending.NOT_STARTED and bool(self.recording.processes)

    @property
    def what(self) -> str:
        """What could not be started, as ``package/executable: why``; or an empty text."""
        for wait in self.recording.waits:
            if wait.what.startswith(_START):
                return wait.what.removeprefix(_START)
        return ""

    @property
    def process(self) -> Process:
        """The process that ran without a node."""
        return self.recording.processes[0]

    def declares(self, kind: str) -> bool:
        """Whether the process declared something of a kind."""
        return declarations.declares(self.recording, kind, self.process.name)


@dataclass(frozen=True)
class OtherNode(NotDone, concept="names"):
    """A node does not have the expected name."""

    wanted: str
    only_failures = True

    @property
    def ended(self) -> Sequence[Process]:
        """None where a node has a like name: that is the one that is meant."""
        # Without the namespaces, which make any two names alike.
        bases = [name.rpartition("/")[2].lower() for name in self.names]
        return super().ended if nearest(self.base.lower(), bases) is None else ()

    @property
    def names(self) -> list[str]:
        """The names of the student's nodes."""
        return [node.name for node in self.recording.written_nodes]

    @property
    def seen(self) -> str:
        """The symptom in words."""
        return f"found the node{'s' if len(self.names) > 1 else ''} {codes(self.names)}"

    @property
    def base(self) -> str:
        """The wanted name without its namespace."""
        return self.wanted.rpartition("/")[2]


def why_no_node(recording: Recording) -> Finding | None:
    """Why the student has no node at all, or None if there is one."""
    return None if recording.student_nodes else cause_of(NoNode(recording))


def why_not_node(recording: Recording, name: str) -> Finding | None:
    """Why a certain node did not appear, or None if it did."""
    if name in [node.name for node in recording.student_nodes]:
        return None
    return why_no_node(recording) or cause_of(OtherNode(recording, name))


def meant_node(recording: Recording, name: str) -> str | None:
    """The name of the one node that a student probably means, or None.

    It has the right name in another namespace, or is the only one, or has the nearest name.
    """
    if any(ended_early(recording, process) for process in recording.processes):
        # What is missing is perhaps not misnamed.
        return None
    # The probe asks every node for these, and for the rest only one that is called as it must.
    asked = {
        call.service.rpartition("/")[0]
        for call in recording.calls
        if not call.service.endswith(tuple(EXECUTOR_SERVICES))
    }
    written = {node.name for node in recording.student_nodes if not OF_ROS.fullmatch(node.name)}
    nodes = set(filter(_NAME.fullmatch, written)) - asked
    bases = {node: node.rpartition("/")[2] for node in nodes}
    meant_base = meant(name.rpartition("/")[2], bases.values())
    candidates = [node for node in nodes if bases[node] == meant_base]
    return candidates[0] if len(candidates) == 1 else None


@explanation(NoNode)
def not_built(symptom: NoNode) -> Finding | None:
    """The packages did not build."""
    submission = symptom.recording.submission
    build, package = submission.build, symptom.what.partition(":")[0].partition("/")[0]
    if symptom.is_launched:
        return None
    if submission.package(package):
        cause = why_not_built(submission, package)
        return cause.after("nothing was launched") if cause is not None else None
    if symptom.what or build is None or build.succeeded:
        return None
    return mistaken(
        "not_launched",
        "nothing was launched, because the packages did not build",
        Evidence(places=(build.culprit,) if build.culprit else ()),
    )


_NOT_STARTED = {
    "Exec format error": "no_interpreter",
    "Permission denied": "not_executable",
    "No such file": "other_interpreter",
}
"""What the system says of a program that it cannot start -> the mistake."""


@explanation(NoNode, before=(process_ended,))
def no_executable(symptom: NoNode) -> Finding | None:
    """The executable does not exist, or cannot be started."""
    if symptom.is_launched:
        return None
    what, _, why = symptom.what.partition(": ")
    packages = symptom.recording.submission.packages
    installed = [name for package in packages for name in package.executables]
    seen = f"{code(what)} could not be started: {why}"
    if not why:
        seen = "nothing was launched, because the executable does not exist"
    if installed:
        seen += f"; installed are {codes(installed)}"
    mistakes = [mistake for words, mistake in _NOT_STARTED.items() if words in why]
    return mistaken(mistakes[0] if mistakes else "no_executable", seen)


@explanation(NoNode, after=(process_ended,))
def never_appeared(symptom: NoNode) -> Finding | None:
    """The node never appeared in the ROS graph, as after a change of ROS_DOMAIN_ID."""
    if not symptom.declares("node") and not symptom.recording.environment.get("other_domains"):
        return None
    return why_never_appeared(symptom.recording, "a node")


@explanation(NoNode, general=True)
def main_does_not_come_to_it(symptom: NoNode) -> Finding:
    """main() creates no node: a loop, time.sleep() or input() comes before it."""
    recording, name = symptom.recording, symptom.process.name
    stand = where_it_stands(recording, name)
    if symptom.declares("init"):
        done = f"called {INIT} but created no node"
    elif declarations.traced(recording, name):
        done = f"never called {INIT}"
    else:
        done = "created no node"
    lines = tuple(line.text for line in recording.log if line.process == name)
    cause = mistaken(
        "main_does_not_come_to_it",
        f"the process {code(name)} ran until the end, but {done}",
        Evidence(
            moments=(until_the_end(recording, "still no node when the observation ended"),),
            log=lines[-_LOG_LINES:],
        ),
    )
    return at_its_place(cause, cause.observed, stand)


@explanation(OtherNode, after=(process_ended,))
def node_never_appeared(symptom: OtherNode) -> Finding | None:
    """The process created the node, but it never appeared in the ROS graph."""
    # A process may declare anything, also what is no text.
    declared = {str(item.data.get("node")) for item in symptom.recording.declared("node")}
    # A process that shows as many nodes as it declared only calls them by other names.
    seen = {node.name for node in symptom.recording.student_nodes}
    if symptom.wanted not in declared or len(declared) <= len(seen):
        return None
    cause = why_never_appeared(symptom.recording, f"the node {code(symptom.wanted)}")
    return cause.after(symptom.seen)


@explanation(OtherNode, general=True)
def other_name(symptom: OtherNode) -> Finding:
    """The node has another name: wrong upper or lower case, a namespace, or a misspelling."""
    how = ""
    for name in symptom.names:
        space, _, base = name.rpartition("/")
        if name.lower() == symptom.wanted.lower():
            how = ": upper and lower case differ"
        elif base == symptom.base:
            how = f": the name is right, but the node is in the namespace {code(space or '/')}"
    return mistaken(
        "other_node_name",
        f"{symptom.seen}{how}",
        Evidence(moments=nodes_seen(symptom.recording)),
        base=symptom.base,
    )
