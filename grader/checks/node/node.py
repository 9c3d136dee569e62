"""Checks of nodes: whether they appear, stay alive, and end when they are asked to."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import NoParameters, Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment
from grader.checks.first_seen import endpoints_seen
from grader.checks.node.target_nodes import target_nodes
from grader.checks.wording import code, codes, counted, listing
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_node import why_no_node, why_not_node
from grader.diagnosis.process.process_exit import (
    ended_early,
    exited,
    offence,
    why_ended,
    why_it_exited,
)
from grader.measure import declarations
from grader.recording.model import NS, Kind, Node, Process, Recording
from grader.spec.name import QualifiedNodeName, TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration


@check("node.starts", Subject.RECORDING)
def starts(recording: Recording, parameters: NoParameters) -> Finding:
    """The program starts and has a node.

    Judged by the ROS graph: any node of the student was seen, whatever its name.
    """
    expected = "the program creates a node"
    missing = why_no_node(recording)
    if missing is not None:
        return missing.finding(expected)
    first = recording.student_nodes[0]
    when_s = recording.since_launch_s(first.appeared_ns)
    return Finding.passed(
        expected,
        f"{code(first.name)} appeared {when_s:.2f} s after launch",
        Evidence(moments=(Moment(f"node {first.name} appeared", when_s),)),
    )


class NodeExists(Parameters):
    """Parameters of node.exists."""

    name: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    publishes: TopicName | None = Field(
        None, description="Topic on which this node, and no other one of the student's, publishes."
    )


@check("node.exists", Subject.RECORDING, NodeExists)
def exists(recording: Recording, parameters: NodeExists) -> Finding:
    """The node appears under its name.

    Judged by the ROS graph: a node of the student with this fully qualified name was seen.
    """
    expected = f"a node {code(parameters.name)}"
    missing = why_not_node(recording, parameters.name) or _other_publisher(recording, parameters)
    if missing is not None:
        return missing.finding(expected)
    node = next(item for item in recording.student_nodes if item.name == parameters.name)
    when_s = recording.since_launch_s(node.appeared_ns)
    return Finding.passed(
        expected,
        f"it appeared {when_s:.2f} s after launch",
        Evidence(moments=(Moment(f"node {node.name} appeared", when_s),)),
    )


def _other_publisher(recording: Recording, parameters: NodeExists) -> Cause | None:
    """Another node publishes what this one should; a topic without a publisher is no matter."""
    if parameters.publishes is None:
        return None
    publishers = recording.student_endpoints(Kind.PUBLISHER, parameters.publishes)
    others = sorted({item.node for item in publishers} - {parameters.name})
    if not others:
        return None
    return Cause(
        f"{code(parameters.name)} is there, but {codes(others)} publishes on "
        f"{code(parameters.publishes)}",
        "Create the publisher with self.create_publisher(...) in the node that is asked for.",
        Evidence(moments=endpoints_seen(recording, publishers)),
    )


class Alive(Parameters):
    """Parameters of node.alive."""

    name: QualifiedNodeName | None = Field(
        None, description="Name of the node; by default everything that was launched."
    )


@check("node.alive", Subject.RECORDING, Alive)
def alive(recording: Recording, parameters: Alive) -> Finding:
    """The node stays alive until it is asked to end.

    Judged by the process, which must still run when the observation ends, and by the ROS
    graph, which must not have lost the node before. Of several nodes those count that publish
    what is recorded, or subscribe to what they are sent; a helper node may come and go. What a
    sandbox never allows, such as a signal to the process that holds it, ends a node.
    """
    who = code(parameters.name) if parameters.name else "the node"
    expected = f"{who} runs until SIGINT (Ctrl-C)"
    missing = (
        why_not_node(recording, parameters.name) if parameters.name else why_no_node(recording)
    )
    process = declarations.process_of(recording, parameters.name) if parameters.name else None
    ended = [process] if process and ended_early(recording, process) else []
    if not ended and (parameters.name is None or process is None):
        ended = list(exited(recording))
    if ended:
        return why_it_exited(recording, ended[0]).finding(expected)
    seen = offence(recording) or missing
    if seen is not None:
        return seen.finding(expected)
    gone = _gone(recording, parameters.name)
    if gone is not None:
        when_s = recording.since_launch_s(gone.vanished_ns or recording.stop_ns)
        return Finding.failed(
            expected,
            f"the node {code(gone.name)} left the ROS graph {when_s:.2f} s after launch, although "
            "its process still ran",
            "Call destroy_node() and rclpy.shutdown() only after rclpy.spin() has returned.",
            Evidence(moments=(Moment(f"node {gone.name} vanished", when_s),)),
        )
    watched_s = recording.since_launch_s(recording.stop_ns)
    return Finding.passed(expected, f"it ran for {format_duration(watched_s)}, until SIGINT")


def _gone(recording: Recording, name: str | None) -> Node | None:
    """A node that the scenario is about, and that vanished early without a sign of life after."""
    if name is not None:
        nodes = tuple(node for node in recording.student_nodes if node.name == name)
        return next((node for node in nodes if _vanished(recording, node)), None)
    concerned = target_nodes(recording)
    nodes = concerned or recording.student_nodes
    gone = [node for node in nodes if _vanished(recording, node)]
    # Of nodes that the scenario is not about, one is as good as another.
    return gone[0] if gone and (concerned or len(gone) == len(nodes)) else None


def _vanished(recording: Recording, node: Node) -> bool:
    if node.vanished_ns is None or node.vanished_ns >= recording.stop_ns:
        return False
    # What a stimulus ends is meant to vanish, within the lease of its participant.
    if any(item.time_ns <= node.vanished_ns for item in recording.interventions):
        return False
    return not _lives_after(recording, node.name, node.vanished_ns)


def _lives_after(recording: Recording, name: str, time_ns: int) -> bool:
    # The graph can lose a node for a moment on a busy machine; what it does tells better.
    again = any(
        node.name == name and (node.vanished_ns is None or node.vanished_ns > time_ns)
        for node in recording.student_nodes
    )
    answered = any(
        call.service.startswith(f"{name}/") and (call.answered_ns or 0) > time_ns
        for call in recording.calls
    )
    # Not what it subscribed to: that others publish.
    topics = {
        item.topic for item in recording.student_endpoints(Kind.PUBLISHER) if item.node == name
    }
    published = any(
        message.stamp_ns > time_ns for topic in topics for message in recording.on(topic)[-1:]
    )
    return again or answered or published


class Ends(Parameters):
    """Parameters of node.ends."""

    within: Duration = Field(description="How long the process may take to end after SIGINT.")


@check("node.ends", Subject.RECORDING, Ends)
def ends(recording: Recording, parameters: Ends) -> Finding:
    """The process ends by itself after Ctrl-C.

    Judged by the process: after SIGINT it must end in time, and leave no process behind. Its
    exit status does not matter, nor does a traceback of KeyboardInterrupt.
    """
    expected = f"the process ends within {format_duration(parameters.within)} of SIGINT (Ctrl-C)"
    if not recording.processes:
        missing = why_no_node(recording) or Cause("nothing was launched")
        return missing.finding(expected)
    ended = why_ended(recording, "it had already ended before SIGINT")
    if ended is not None:
        return ended.finding(expected)
    stuck = [process for process in recording.processes if process.exited_ns is None]
    if stuck:
        return Finding.error(
            expected,
            f"{codes(process.name for process in stuck)} could not be ended, not even by SIGKILL",
        )
    asked = [process for process in recording.processes if not _was_killed(recording, process)]
    slow = [process for process in asked if not _in_time(process, parameters)]
    if slow:
        worst = max(slow, key=lambda process: _stop_s(recording, process))
        return _too_late(recording, worst, parameters).finding(expected)
    leaving = [process for process in recording.processes if process.survivors]
    if leaving:
        return _survived(recording, leaving[0]).finding(expected)
    if not asked:
        return Finding.error(expected, "a stimulus of the scenario had ended it before")
    longest_s = max(_stop_s(recording, process) for process in asked)
    return Finding.passed(
        expected,
        f"ended {format_duration(longest_s)} after SIGINT",
        Evidence(moments=(Moment("SIGINT", recording.since_launch_s(recording.stop_ns)),)),
    )


def _was_killed(recording: Recording, process: Process) -> bool:
    """Whether a stimulus ended it in the middle of the run."""
    ended_ns = process.exited_ns
    return (
        process.stopped_by != "itself"
        and ended_ns is not None
        and any(
            item.process == process.name and item.action == "kill" and item.time_ns <= ended_ns
            for item in recording.interventions
        )
        and ended_ns < recording.stop_ns
    )


def _in_time(process: Process, parameters: Ends) -> bool:
    if process.stopped_by not in ("SIGINT", "itself"):
        return False
    return process.stop_s is None or process.stop_s <= parameters.within


def _stop_s(recording: Recording, process: Process) -> float:
    """Seconds from SIGINT to the end of a process."""
    if process.stop_s is not None:
        return process.stop_s
    return max(((process.exited_ns or recording.end_ns) - recording.stop_ns) / NS, 0.0)


def _too_late(recording: Recording, process: Process, parameters: Ends) -> Cause:
    took_s = _stop_s(recording, process)
    end_ns = process.exited_ns or recording.end_ns
    if process.stopped_by == "SIGINT":
        observed = f"{code(process.name)} needed {format_duration(took_s)} to end after SIGINT"
    else:
        observed = f"{code(process.name)} did not end after SIGINT; {process.stopped_by} was needed"
    stolen_s = recording.stolen_s(recording.stop_ns, end_ns)
    if stolen_s > 0.0 and took_s - stolen_s <= parameters.within:
        return Cause.to_repeat(
            f"{observed}, but the machine took {format_duration(stolen_s)} from it meanwhile"
        )
    stop_s = recording.since_launch_s(recording.stop_ns)
    return Cause(
        observed,
        "Ctrl-C raises KeyboardInterrupt: look for a bare `except:` or `except BaseException:` "
        "in a loop that swallows it, for a signal handler of your own, for a callback that "
        "sleeps or loops, and for a thread that is not a daemon.",
        Evidence(
            moments=(
                Moment("SIGINT", stop_s),
                Moment(f"{process.name} ended", recording.since_launch_s(end_ns)),
            ),
            log=tuple(
                line.text
                for line in recording.log
                if line.process == process.name and line.time_ns >= recording.stop_ns
            )[-10:],
        ),
    )


def _survived(recording: Recording, process: Process) -> Cause:
    number = counted(len(process.survivors), "process", "processes")
    return Cause(
        f"{code(process.name)} left {number} running behind it: "
        f"{listing(code(command) for command in process.survivors)}",
        "End child processes before main() returns: process.terminate(), then process.wait().",
        Evidence(
            moments=(
                Moment(
                    f"{process.name} ended",
                    recording.since_launch_s(process.exited_ns or recording.end_ns),
                ),
            )
        ),
    )
