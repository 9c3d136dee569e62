"""Why no node of the student appeared: nothing launched, died, hangs, or has another name."""

from __future__ import annotations

from dataclasses import dataclass

from grader.checks.finding import Evidence, Moment
from grader.checks.first_seen import nodes_seen, until_the_end
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.exchanged_executables import why_exchanged
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.not_built import why_not_built
from grader.diagnosis.process.process_exit import crashed, why_ended, why_it_exited
from grader.diagnosis.process.raised import interrupted_place
from grader.diagnosis.undeclared import why_never_appeared
from grader.measure import declarations
from grader.recording.model import Ending, Process, Recording
from grader.spec.nearest_name import nearest
from grader.submission.record import SourceError

_LOG_LINES = 10
# How the cell calls the wait for a process that it could not start.
_START = "start of "


@dataclass(frozen=True)
class NoNode(Symptom[Cause]):
    """No node of the student's appeared."""

    recording: Recording

    @property
    def is_launched(self) -> bool:
        """Whether a process was started."""
        return self.recording.ending is not Ending.NOT_STARTED and bool(self.recording.processes)

    @property
    def what(self) -> str:
        """What could not be started, as ``package/executable: why``; or an empty text."""
        waits = self.recording.waits
        start = next((wait.what for wait in waits if wait.what.startswith(_START)), "")
        return start.removeprefix(_START)

    @property
    def process(self) -> Process:
        """The process that ran without a node."""
        return self.recording.processes[0]

    @property
    def who(self) -> str:
        """The same in words."""
        return f"the process {code(self.process.name)}"

    @property
    def place(self) -> SourceError | None:
        """Where it was when it was interrupted."""
        return interrupted_place(self.recording, self.process.name)

    @property
    def where(self) -> str:
        """The same in words, with a space before."""
        return f" ({self.place.file}:{self.place.line})" if self.place else ""

    @property
    def evidence(self) -> Evidence:
        """The place, and its last lines of output."""
        name = self.process.name
        lines = tuple(line.text for line in self.recording.log if line.process == name)
        return Evidence(
            moments=(self.nothing,),
            places=(self.place,) if self.place else (),
            log=lines[-_LOG_LINES:],
        )

    @property
    def nothing(self) -> Moment:
        """That there was still no node."""
        return until_the_end(self.recording, "still no node when the observation ended")

    def declares(self, kind: str) -> bool:
        """Whether the process declared something of a kind."""
        return declarations.said(self.recording, kind, self.process.name)


@dataclass(frozen=True)
class OtherNode(Symptom[Cause]):
    """A node has another name than is expected."""

    recording: Recording
    wanted: str

    @property
    def names(self) -> list[str]:
        """The names of the student's nodes."""
        return [node.name for node in self.recording.student_nodes]

    @property
    def there(self) -> str:
        """The same in words."""
        return f"found the node {codes(self.names)}"

    @property
    def base(self) -> str:
        """The wanted name without its namespace."""
        return self.wanted.rpartition("/")[2]


def why_no_node(recording: Recording) -> Cause | None:
    """Why the student has no node at all, or None if there is one."""
    return None if recording.student_nodes else cause_of(NoNode(recording))


def why_not_node(recording: Recording, name: str) -> Cause | None:
    """Why a certain node did not appear, or None if it did."""
    if name in [node.name for node in recording.student_nodes]:
        return None
    return why_no_node(recording) or cause_of(OtherNode(recording, name))


@explanation(NoNode)
def package_not_built(symptom: NoNode) -> Cause | None:
    """The package was not built."""
    submission = symptom.recording.submission
    package = symptom.what.partition(":")[0].partition("/")[0]
    if symptom.is_launched or not submission.package(package):
        return None
    cause = why_not_built(submission, package)
    return cause and cause.after("nothing was launched")


@explanation(NoNode)
def nothing_built(symptom: NoNode) -> Cause | None:
    """The packages did not build."""
    build = symptom.recording.submission.build
    if symptom.is_launched or symptom.what or build is None or build.succeeded:
        return None
    return Cause(
        "nothing was launched, because the packages did not build",
        "Correct the build first: `colcon build` names the line.",
        Evidence(places=(build.culprit,) if build.culprit else ()),
    )


@explanation(NoNode)
def no_executable(symptom: NoNode) -> Cause | None:
    """The executable does not exist, or cannot be started."""
    if symptom.is_launched:
        return None
    what, _, why = symptom.what.partition(": ")
    packages = symptom.recording.submission.packages
    installed = [name for package in packages for name in package.executables]
    there = f"; installed are {codes(installed)}" if installed else ""
    return Cause(
        f"{code(what)} could not be started: {why}{there}"
        if why
        else f"nothing was launched, because the executable does not exist{there}",
        "The executable's name is the left side of an entry of console_scripts in setup.py.",
    )


@explanation(NoNode)
def process_ended(symptom: NoNode) -> Cause | None:
    """The process ended before it created a node."""
    return why_ended(symptom.recording)


@explanation(NoNode)
def other_domain(symptom: NoNode) -> Cause | None:
    """The program sets ROS_DOMAIN_ID, or joins another domain."""
    others = symptom.recording.environment.get("other_domains")
    if not others:
        return None
    return Cause(
        f"{symptom.who} joined ROS domain {others} and not the one that it was started in",
        "Do not set ROS_DOMAIN_ID or domain_id in the code: the environment chooses it.",
        Evidence(moments=(symptom.nothing,)),
    )


@explanation(NoNode)
def never_appeared(symptom: NoNode) -> Cause | None:
    """The process created a node, but it never appeared in the ROS graph."""
    if not symptom.declares("node"):
        return None
    return why_never_appeared(symptom.recording, "a node")


@explanation(NoNode)
def waits_for_input(symptom: NoNode) -> Cause | None:
    """The program waits for input() before it creates a node."""
    if symptom.place is None or "input(" not in symptom.place.message:
        return None
    return Cause(
        f"{symptom.who} waits for input(){symptom.where}, and no node appeared",
        "A launched node has no keyboard: take the value from a ROS parameter.",
        symptom.evidence,
    )


@explanation(NoNode)
def init_without_node(symptom: NoNode) -> Cause | None:
    """The program calls rclpy.init(), and creates no node."""
    if not symptom.declares("init"):
        return None
    return Cause(
        f"{symptom.who} called rclpy.init() but created no node until the end{symptom.where}",
        "Create the node right after rclpy.init(): no loop and no sleep before it.",
        symptom.evidence,
    )


@explanation(NoNode)
def no_init(symptom: NoNode) -> Cause | None:
    """The program does not come to rclpy.init()."""
    if not declarations.traced(symptom.recording, symptom.process.name):
        return None
    return Cause(
        f"{symptom.who} ran until the end but never called rclpy.init(){symptom.where}",
        "Look for a loop, a sleep or input() at the top level of a module or before "
        "rclpy.init() in main().",
        symptom.evidence,
    )


@explanation(NoNode, general=True)
def no_node_appeared(symptom: NoNode) -> Cause:
    """The process runs, but no node appears."""
    return Cause(
        f"{symptom.who} ran until the end, but no node appeared{symptom.where}",
        "main() must call rclpy.init() and create the node; nothing may block before that.",
        symptom.evidence,
    )


@explanation(OtherNode)
def other_case(symptom: OtherNode) -> Cause | None:
    """Upper and lower case of the node's name differ."""
    if not any(name.lower() == symptom.wanted.lower() for name in symptom.names):
        return None
    return Cause(
        f"{symptom.there}: upper and lower case differ",
        f"Names in ROS are case-sensitive: super().__init__('{symptom.base}').",
        Evidence(moments=nodes_seen(symptom.recording)),
    )


@explanation(OtherNode)
def in_a_namespace(symptom: OtherNode) -> Cause | None:
    """The node is in a namespace."""
    split = [name.rpartition("/") for name in symptom.names]
    space = next((space for space, _, base in split if base == symptom.base), None)
    if space is None:
        return None
    return Cause(
        f"{symptom.there}: the name is right, but the node is in the namespace "
        f"{code(space or '/')}",
        "Leave out the namespace argument of Node.__init__ (and any `__ns` remapping) "
        "unless the assignment asks for it.",
        Evidence(moments=nodes_seen(symptom.recording)),
    )


@explanation(OtherNode)
def process_crashed(symptom: OtherNode) -> Cause | None:
    """The process of the node ended with a failure before it created the node."""
    ended = crashed(symptom.recording)
    # Without the namespaces, which make any two names alike.
    bases = [name.rpartition("/")[2] for name in symptom.names]
    if not ended or nearest(symptom.base, bases) is not None:
        return None
    return why_it_exited(symptom.recording, ended[0])


@explanation(OtherNode)
def node_never_appeared(symptom: OtherNode) -> Cause | None:
    """The process created the node, but it never appeared in the ROS graph."""
    # A process may declare anything, also what is no text.
    declared = {str(item.data.get("node")) for item in symptom.recording.declared("node")}
    # A process that shows as many nodes as it declared only calls them by other names.
    if symptom.wanted not in declared or len(declared) <= len(set(symptom.names)):
        return None
    cause = why_never_appeared(symptom.recording, f"the node {code(symptom.wanted)}")
    return cause.after(symptom.there)


@explanation(OtherNode)
def exchanged_executables(symptom: OtherNode) -> Cause | None:
    """In setup.py an executable runs the function of another one."""
    exchanged = why_exchanged(symptom.recording)
    return exchanged and exchanged.after(symptom.there)


@explanation(OtherNode, general=True)
def other_name(symptom: OtherNode) -> Cause:
    """The node has another name."""
    return Cause(
        symptom.there,
        f"The node's name is the argument of super().__init__('{symptom.base}') in its "
        "constructor.",
        Evidence(moments=nodes_seen(symptom.recording)),
    )
