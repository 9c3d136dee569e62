"""Why no node of the student appeared: nothing launched, died, hangs, or has another name."""

from __future__ import annotations

from grader.checks import declarations
from grader.checks.finding import Evidence
from grader.checks.first_seen import nodes_seen, until_the_end
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.exchanged_executables import why_exchanged
from grader.diagnosis.not_built import why_not_built
from grader.diagnosis.process.process_exit import crashed, why_ended, why_it_exited
from grader.diagnosis.process.raised import interrupted_place
from grader.recording.model import Ending, Process, Recording
from grader.spec.nearest_name import nearest

_LOG_LINES = 10
# How the cell calls the wait for a process that it could not start.
_START = "start of "


def why_no_node(recording: Recording) -> Cause | None:
    """Why the student has no node at all, or None if there is one."""
    if recording.student_nodes:
        return None
    if recording.ending is Ending.NOT_STARTED or not recording.processes:
        return _not_started(recording)
    return why_ended(recording) or _hangs(recording, recording.processes[0])


def why_not_node(recording: Recording, name: str) -> Cause | None:
    """Why a certain node did not appear, or None if it did."""
    names = [node.name for node in recording.student_nodes]
    if name in names:
        return None
    return why_no_node(recording) or _other_name(recording, name, names)


def _not_started(recording: Recording) -> Cause:
    start = next((w.what for w in recording.waits if w.what.startswith(_START)), "")
    what, _, why = start.removeprefix(_START).partition(": ")
    submission, build = recording.submission, recording.submission.build
    package = what.partition("/")[0]
    unbuilt = submission.package(package) and why_not_built(submission, package)
    if unbuilt:
        return unbuilt.after("nothing was launched")
    if build is not None and not build.succeeded and not what:
        return Cause(
            "nothing was launched, because the packages did not build",
            "Mend the build first: `colcon build` names the line.",
            Evidence(places=(build.culprit,) if build.culprit else ()),
        )
    installed = [name for package in recording.submission.packages for name in package.executables]
    there = f"; installed are {codes(installed)}" if installed else ""
    return Cause(
        f"{code(what)} could not be started: {why}{there}"
        if why
        else f"nothing was launched, because the executable does not exist{there}",
        "The executable's name is the left side of an entry of console_scripts in setup.py.",
    )


def _hangs(recording: Recording, process: Process) -> Cause:
    """A process that still ran, but showed no node."""
    name, who = process.name, f"the process {code(process.name)}"
    nothing = until_the_end(recording, "still no node when the observation ended")
    others = recording.environment.get("other_domains")
    if others:
        return Cause(
            f"{who} joined ROS domain {others} and not the one that it was started in",
            "Do not set ROS_DOMAIN_ID or domain_id in the code: the environment chooses it.",
            Evidence(moments=(nothing,)),
        )
    if declarations.said(recording, "node", name):
        return declarations.why_never_appeared(recording, "a node")
    place = interrupted_place(recording, name)
    evidence = Evidence(
        moments=(nothing,),
        places=(place,) if place else (),
        log=tuple(line.text for line in recording.log if line.process == name)[-_LOG_LINES:],
    )
    where = f" ({place.file}:{place.line})" if place else ""
    if place and "input(" in place.message:
        return Cause(
            f"{who} waits for input(){where}, and no node appeared",
            "A launched node has no keyboard: take the value from a ROS parameter.",
            evidence,
        )
    if declarations.said(recording, "init", name):
        return Cause(
            f"{who} called rclpy.init() but created no node until the end{where}",
            "Create the node right after rclpy.init(): no loop and no sleep before it.",
            evidence,
        )
    if declarations.traced(recording, name):
        return Cause(
            f"{who} ran until the end but never called rclpy.init(){where}",
            "Look for a loop, a sleep or input() at the top level of a module or before "
            "rclpy.init() in main().",
            evidence,
        )
    return Cause(
        f"{who} ran until the end, but no node appeared{where}",
        "main() must call rclpy.init() and create the node; nothing may block before that.",
        evidence,
    )


def _other_name(recording: Recording, wanted: str, names: list[str]) -> Cause:
    there = f"found the node {codes(names)}"
    base = wanted.rpartition("/")[2]
    evidence = Evidence(moments=nodes_seen(recording))
    for name in names:
        if name.lower() == wanted.lower():
            return Cause(
                f"{there}: upper and lower case differ",
                f"Names in ROS are case-sensitive: super().__init__('{base}').",
                evidence,
            )
    for name in names:
        if name.rpartition("/")[2] == base:
            namespace = name.rpartition("/")[0] or "/"
            return Cause(
                f"{there}: the name is right, but the node is in the namespace {code(namespace)}",
                "Leave out the namespace argument of Node.__init__ (and any `__ns` remapping) "
                "unless the assignment asks for it.",
                evidence,
            )
    # Without the namespaces, which make any two names alike.
    if nearest(base, [name.rpartition("/")[2] for name in names]) is None:
        ended = crashed(recording)
        if ended:
            return why_it_exited(recording, ended[0])
    # A process may declare anything, also what is no text.
    declared = {str(item.data.get("node")) for item in recording.declared("node")}
    # A process that shows as many nodes as it declared only calls them by other names.
    if wanted in declared and len(declared) > len(set(names)):
        return declarations.why_never_appeared(recording, f"the node {code(wanted)}").after(there)
    exchanged = why_exchanged(recording)
    if exchanged is not None:
        return exchanged.after(there)
    return Cause(
        there,
        f"The node's name is the argument of super().__init__('{base}') in its constructor.",
        evidence,
    )
