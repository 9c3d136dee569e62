"""Checks of nodes: whether they appear, stay alive, and end when they are asked to."""

from __future__ import annotations

from functools import partial

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.doubt import HELD_UP_S
from grader.checks.wrong_name import Named, misnamed
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_node import meant_node, why_no_node, why_not_node
from grader.diagnosis.process.not_called import left_s
from grader.diagnosis.process.process_exit import (
    crashed,
    ended_early,
    exited,
    offence,
    why_ended,
    why_it_exited,
)
from grader.findings.finding import (
    Evidence,
    Finding,
    Moment,
    endpoints_seen,
    evidence_at,
    moment,
    nodes_seen,
    until_the_end,
)
from grader.findings.words import code, codes, counted
from grader.measure import declarations
from grader.recording.event import LONGEST_STRETCH
from grader.recording.model import NS, Kind, Node, Owner, Process, Recording
from grader.spec.name import QualifiedNodeName, TopicName
from grader.spec.names import Thing
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

_APART_S = 0.01
"""Two looks for ended processes: what is nearer has no order."""


class Starts(Parameters):
    """Parameters of node.starts."""

    asks = "the program creates a node"


@check("node.starts", Subject.RECORDING, Starts, concept="nodes")
def starts(recording: Recording, parameters: Starts) -> Finding:
    """The program starts and has a node.

    Judged by the ROS graph: any node of the student was seen, whatever its name.
    """
    stop_if(why_no_node(recording))
    first = recording.student_nodes[0]
    return _appeared(recording, parameters, first, code(first.name))


def _appeared(recording: Recording, parameters: Parameters, node: Node, what: str) -> Finding:
    when_s = recording.since_launch_s(node.appeared_ns)
    shown = evidence_at(recording, f"node {node.name} appeared", node.appeared_ns)
    return Finding.as_asked(f"{what} appeared {when_s:.2f} s after launch", shown)


class NodeExists(Named):
    """Parameters of node.exists."""

    asks = "a node `{self.name}`"
    thing, called = Thing.NODE, "{self.name}"

    name: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    publishes: TopicName | None = Field(
        None, description="Topic on which only this node of the student publishes."
    )


@check("node.exists", Subject.RECORDING, NodeExists, concept="names")
def exists(recording: Recording, parameters: NodeExists) -> Finding:
    """The node appears under its name.

    Judged by the ROS graph: a node of the student with this fully qualified name was seen.
    """
    cause, shown = why_not_node(recording, parameters.name), Evidence(moments=nodes_seen(recording))
    meant = meant_node(recording, parameters.name)
    stop_if(misnamed(recording, parameters, cause, meant, shown))
    publishers = recording.student_endpoints(Kind.PUBLISHER, parameters.publishes)
    others = sorted({item.node for item in publishers} - {parameters.name})
    if parameters.publishes is not None and others:
        return mistaken(
            "other_publisher",
            f"{code(parameters.name)} is there, but {codes(others)} publishes on "
            f"{code(parameters.publishes)}",
            Evidence(moments=endpoints_seen(recording, publishers)),
        )
    node = next(item for item in recording.student_nodes if item.name == parameters.name)
    return _appeared(recording, parameters, node, "it")


def target_nodes(recording: Recording) -> tuple[Node, ...]:
    """The student's nodes that publish what the probe subscribes to, or subscribe to what it sends.

    In the order of their appearance. What becomes of other nodes is the program's own affair.
    """
    ends = {(item.kind, item.topic) for item in recording.endpoints if item.owner is Owner.PROBE}
    names = {
        item.node
        for item in recording.endpoints
        if item.owner is Owner.STUDENT
        and any(kind is not item.kind and topic == item.topic for kind, topic in ends)
    }
    return tuple(node for node in recording.written_nodes if node.name in names)


class Alive(Parameters):
    """Parameters of node.alive."""

    name: QualifiedNodeName | None = Field(
        None, description="Name of the node; by default all that were launched."
    )

    def _asked(self) -> str:
        return f"{code(self.name) if self.name else 'the node'} runs until SIGINT (Ctrl-C)"


@check("node.alive", Subject.RECORDING, Alive, concept="nodes")
def alive(recording: Recording, parameters: Alive) -> Finding:
    """The node stays alive until it is asked to end.

    Judged by the process, which must still run when the observation ends, and by the ROS graph,
    which must not have lost the node before. Of several nodes, only those count that publish on a
    recorded topic or subscribe to a topic of a stimulus; a helper node may end earlier. What the
    sandbox forbids, such as a signal to its first process, also fails.
    """
    name = parameters.name
    process = declarations.process_of(recording, name) if name else None
    ended = exited(recording)
    if process is not None:
        ended = tuple(one for one in ended if one is process)
    if ended:
        return why_it_exited(recording, ended[0])
    stop_if(offence(recording))
    stop_if(why_not_node(recording, name) if name else why_no_node(recording))
    stop_if(_why_gone(recording, name))
    watched_s = recording.since_launch_s(recording.stop_ns)
    observed = f"it ran for {format_duration(watched_s)}, until SIGINT"
    return Finding.as_asked(observed)


def _why_gone(recording: Recording, name: str | None) -> Finding | None:
    """Why a node that the scenario is about vanished early, without a sign of life after it."""
    concerned = target_nodes(recording)
    nodes = concerned or recording.student_nodes
    if name is not None:
        nodes = tuple(node for node in recording.student_nodes if node.name == name)
    gone = [node for node in nodes if _vanished(recording, node)]
    # Of nodes that the scenario is not about, one is as good as another.
    if not gone or (name is None and not concerned and len(gone) < len(nodes)):
        return None
    gone_ns = gone[0].vanished_ns or recording.stop_ns
    return mistaken(
        "destroyed",
        f"the node {code(gone[0].name)} left the ROS graph "
        f"{recording.since_launch_s(gone_ns):.2f} s after launch, although its process still ran",
        evidence_at(recording, f"node {gone[0].name} vanished", gone_ns),
    )


def _vanished(recording: Recording, node: Node) -> bool:
    gone_ns = node.vanished_ns
    if gone_ns is None or gone_ns >= recording.stop_ns:
        return False
    # What a stimulus ends is meant to vanish, within the lease of its participant.
    process = declarations.process_of(recording, node.name)
    for done in recording.interventions:
        if done.time_ns <= gone_ns and (process is None or process.name == done.process):
            return False
    # The graph can lose a node for a moment on a busy machine; what it does tells better. What it
    # subscribed to tells nothing: others publish that.
    appeared_again = any(
        other.name == node.name and (other.vanished_ns is None or other.vanished_ns > gone_ns)
        for other in recording.student_nodes
    )
    answered = any(
        call.service.startswith(f"{node.name}/") and (call.answered_ns or 0) > gone_ns
        for call in recording.calls
    )
    published = any(
        message.stamp_ns > gone_ns
        for item in recording.student_endpoints(Kind.PUBLISHER)
        if item.node == node.name
        for message in recording.on(item.topic)[-1:]
    )
    return not (appeared_again or answered or published)


class Finishes(Parameters):
    """Parameters of node.finishes."""

    asks = "the program ends by itself, with exit code 0"


@check("node.finishes", Subject.RECORDING, Finishes, concept="nodes")
def finishes(recording: Recording, parameters: Finishes) -> Finding:
    """The program ends by itself when its work is done.

    Judged by the process: it ended before the observation did, with exit code 0. The scenario has
    to leave it the time, by its `timeout` or `until`.
    """
    stop_if(why_no_node(recording))
    if not recording.processes:
        return Finding("nothing was launched")
    for process in crashed(recording):
        stop_if(why_it_exited(recording, process))
    stop_if(offence(recording))
    running = [one for one in recording.processes if not ended_early(recording, one)]
    if running:
        seen = f"{codes(one.name for one in running)} ran until SIGINT (Ctrl-C)"
        found = mistaken("never_ends", seen, Evidence(moments=(until_the_end(recording),)))
        return found.doubted(declarations.was_held_up(recording))
    ended = max(recording.processes, key=lambda one: one.exited_ns or 0)
    shown = Evidence(moments=(_end(recording, ended),))
    return Finding.as_asked("it ended by itself, with exit code 0", shown)


class Ends(Parameters):
    """Parameters of node.ends."""

    within: Duration = Field(description="Longest time from SIGINT to the end of the process.")
    node: QualifiedNodeName | None = Field(
        None, description="A node whose process ends before that of another; goes with `before`."
    )
    before: QualifiedNodeName | None = Field(None, description="The other node.")

    @model_validator(mode="after")
    def _is_an_order(self) -> Ends:
        if (self.node is None) != (self.before is None):
            raise ValueError("'node' and 'before' go together")
        return self

    def _asked(self) -> str:
        within = f"within {format_duration(self.within)} of SIGINT (Ctrl-C)"
        if self.node is None:
            return f"the process ends {within}"
        return f"all end {within}, and {code(self.node)} before {code(self.before or '')}"


@check("node.ends", Subject.RECORDING, Ends, concept="nodes")
def ends(recording: Recording, parameters: Ends) -> Finding:
    """The process ends by itself after Ctrl-C.

    Judged by the process: after SIGINT it must end in time and leave no process behind. Delays by
    the machine are taken off. Its exit status and a traceback of KeyboardInterrupt do not matter.
    SIGINT goes to all at once, as in a terminal; with `before`, one has to wait for the other.
    """
    if not recording.processes:
        stop_if(why_no_node(recording) or Finding("nothing was launched"))
    stop_if(why_ended(recording, "it had already ended before SIGINT"))
    processes, took_s = recording.processes, partial(_stop_s, recording)
    stuck = [process.name for process in processes if process.exited_ns is None]
    if stuck:
        text = f"{codes(stuck)} could not be ended, not even by SIGKILL"
        return Finding.ours(text)
    asked = [process for process in processes if not _was_killed(recording, process)]
    slow = [process for process in asked if not _in_time(process, parameters)]
    if slow:
        stop_if(_why_slow(recording, max(slow, key=took_s)))
    for process in processes:
        if process.survivors:
            number = counted(len(process.survivors), "process", "processes")
            return mistaken(
                "survivors",
                f"{code(process.name)} left {number} running behind it: {codes(process.survivors)}",
                Evidence(moments=(_end(recording, process),)),
            )
    if not asked:
        return Finding.ours("a stimulus of the scenario had ended it before")
    if parameters.node is not None and parameters.before is not None:
        stop_if(_why_other_order(recording, parameters.node, parameters.before))
    observed = f"ended {format_duration(max(map(took_s, asked)))} after SIGINT"
    return Finding.as_asked(observed, Evidence(moments=(until_the_end(recording, "SIGINT"),)))


def _why_other_order(recording: Recording, node: str, before: str) -> Finding | None:
    """Why the process of a node did not end before that of another, or None if it did."""
    ended_ns: dict[str, int] = {}
    for name in (node, before):
        stop_if(why_not_node(recording, name))
        process = declarations.process_of(recording, name)
        if process is None or process.exited_ns is None:
            return Finding.ours(f"it is not known which process has the node {code(name)}")
        ended_ns[name] = process.exited_ns
    earlier_s = (ended_ns[before] - ended_ns[node]) / NS
    if earlier_s >= _APART_S:
        return None
    seen = f"{code(node)} ended {format_duration(-earlier_s)} after {code(before)}"
    if earlier_s > -_APART_S:
        seen = f"{code(node)} and {code(before)} ended at the same moment"
    ends = [moment(recording, f"{name} ended", at_ns) for name, at_ns in ended_ns.items()]
    found = mistaken("ends_first", seen, Evidence(moments=tuple(ends)), node=code(node))
    # One that waits for a fixed time may be overtaken on a busy machine.
    took_s = recording.stolen_s(recording.stop_ns, max(ended_ns.values()))
    return found.doubted(took_s > HELD_UP_S)


def _was_killed(recording: Recording, process: Process) -> bool:
    """Whether a stimulus ended it in the middle of the run."""
    ended_ns = process.exited_ns or recording.end_ns
    if process.stopped_by == "itself" or ended_ns >= recording.stop_ns:
        return False
    return any(
        item.process == process.name and item.action == "kill" and item.time_ns <= ended_ns
        for item in recording.interventions
    )


def _in_time(process: Process, parameters: Ends) -> bool:
    if process.stopped_by not in ("SIGINT", "itself"):
        return False
    # A process that had ended before has no such time.
    return process.stop_s is None or process.stop_s <= parameters.within


def _stop_s(recording: Recording, process: Process) -> float:
    """Seconds from SIGINT to the end of a process."""
    if process.stop_s is not None:
        return process.stop_s
    return max(((process.exited_ns or recording.end_ns) - recording.stop_ns) / NS, 0.0)


def _why_slow(recording: Recording, process: Process) -> Finding:
    took_s = _stop_s(recording, process)
    seen = f"{code(process.name)} did not end after SIGINT; {process.stopped_by} was needed"
    if process.stopped_by == "SIGINT":
        seen = f"{code(process.name)} needed {format_duration(took_s)} to end after SIGINT"
    # What the machine took is off already, but for a rest that ends a wait on any machine.
    ended_ns = process.exited_ns or recording.end_ns
    wall_s = (ended_ns - recording.stop_ns) / NS
    if left_s(recording, recording.stop_ns, ended_ns) < wall_s / LONGEST_STRETCH:
        return Finding.held_up(seen, recording.stolen_s(recording.stop_ns, ended_ns))
    lines = [
        line.text
        for line in recording.log
        if line.process == process.name and line.time_ns >= recording.stop_ns
    ]
    moments = (until_the_end(recording, "SIGINT"), _end(recording, process))
    shown = Evidence(moments=moments, log=tuple(lines[-10:]))
    return mistaken("ignores_sigint", seen, shown)


def _end(recording: Recording, process: Process) -> Moment:
    return moment(recording, f"{process.name} ended", process.exited_ns or recording.end_ns)
