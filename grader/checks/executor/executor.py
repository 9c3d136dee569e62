"""The check of the executor: whether callbacks keep it from answering."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import median

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Doubt
from grader.checks.node.node import target_nodes
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.not_called import Uncalled, at_its_place, left_s, never_spun
from grader.diagnosis.process.process_exit import ended_early, why_ended, why_it_exited
from grader.diagnosis.process.standing import slow_callback, where_it_stands
from grader.findings.finding import Evidence, Finding, Plot, Verdict, moment, nodes_seen
from grader.findings.words import code, codes, counted, worded
from grader.measure import declarations
from grader.measure.declarations import was_held_up
from grader.recording.interaction import EXECUTOR_SERVICES, executor_services
from grader.recording.model import NS, Call, Kind, Recording
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

# Of two calls, one late one is half of them.
_FORGIVING_FROM = 3
_MOST_MOMENTS = 5
# In this time the graph tells which services a node has, several times over.
_LONG_NS = NS
# Longer than the tracer holds a publisher; a process could declare any time.
_MOST_HELD_NS = 3 * NS


class Responsive(Parameters):
    """Parameters of executor.responsive."""

    about = ("timer", "subscription")
    doubt = Doubt.ANSWER_MISSED

    within: Duration = Field(1.0, description="Longest time for an answer.")
    typically: Duration | None = Field(
        None, description="Longest median of the answer times; by default any."
    )

    def _asked(self) -> str:
        text = f"services of the node answer within {format_duration(self.within)}"
        if self.typically is not None:
            text += f", the median within {format_duration(self.typically)}"
        return text


@dataclass(frozen=True)
class _JudgedCalls:
    """The calls to one node that count, and those of them that were not answered in time."""

    node: str
    judged: list[Call]
    late: list[Call]

    @property
    def allowed_late(self) -> int:
        """How many may be late: a tenth, and one at least unless there are only a few."""
        if len(self.judged) < _FORGIVING_FROM:
            return 0
        return max(1, len(self.judged) // 10)


@check("executor.responsive", Subject.RECORDING, Responsive, concept="executors")
def responsive(recording: Recording, parameters: Responsive) -> Finding:
    """The executor keeps spinning while the node works.

    The probe calls the service `list_parameters` of every node, or `get_type_description` of a node
    without parameter services. A node can answer only while its executor spins. If several nodes
    have the same name, each of them must answer. Calls count from the node's first message on (or,
    if it publishes nothing, from its appearance). Calls at the very end, with too little time for
    an answer, do not count. A callback may be busy for a while if answers still come in time. With
    `typically`, the median of the answer times must be short too.

    If no call can be judged, the check uses what the process declared: that it spins and has a
    timer.
    """
    stop_if(why_no_node(recording))
    nodes = target_nodes(recording) or recording.written_nodes
    names = list(dict.fromkeys(node.name for node in nodes))
    by_node = [_judged_calls(recording, name, parameters.within) for name in names]
    by_node = [calls for calls in by_node if calls.judged]
    if not by_node:
        return _judged_by_declarations(recording, names)
    too_late = [calls for calls in by_node if len(calls.late) > calls.allowed_late]
    if not too_late:
        stop_if(_why_typically_late(recording, parameters.typically, by_node))
        return Finding.as_asked(_summary(by_node, parameters), _evidence(recording, by_node))
    if all(_machine_made_late(recording, calls, parameters.within) for calls in too_late):
        return _machine_took_the_time(_summary(too_late, parameters))
    worst = max(too_late, key=lambda calls: len(calls.late) / len(calls.judged))
    return _why_late(recording, worst, _summary([worst], parameters))


def _judged_calls(recording: Recording, node: str, within_s: float) -> _JudgedCalls:
    since_ns = _working_since_ns(recording, node)
    until_ns = recording.stop_ns - int(within_s * NS)
    services = {service.name for service in recording.services if service.node == node}
    # A service of this name that only another node has answers in this node's place.
    elsewhere = {service.name for service in recording.services} - services
    judged, late = [], []
    for call in _calls_to(recording, node):
        if call.service in elsewhere:
            continue
        is_in_time = call.answered_ns is not None and _wait_s(recording, call) <= within_s
        # An answer in time proves that the executor spins, whenever it was asked for.
        if is_in_time or since_ns <= call.requested_ns <= until_ns:
            judged.append(call)
            if not is_in_time:
                late.append(call)
    return _JudgedCalls(node, judged, late)


def _calls_to(recording: Recording, node: str) -> list[Call]:
    return [call for call in recording.calls if call.service in executor_services(node)]


def _working_since_ns(recording: Recording, node: str) -> int:
    """When a node began to publish, or when it was left to itself if it publishes nothing."""
    first_message_ns = _first_message_ns(recording, node)
    if first_message_ns is not None:
        return first_message_ns
    appeared_ns = min(
        (item.appeared_ns for item in recording.student_nodes if item.name == node),
        default=recording.launched_ns,
    )
    process = declarations.process_of(recording, node)
    if process is None:
        return appeared_ns
    since_ns = max(appeared_ns, _spinning_since_ns(recording, node, process.name))
    return max(since_ns, _held_until_ns(recording, process.name, since_ns))


def _first_message_ns(recording: Recording, node: str) -> int | None:
    topics = {
        publisher.topic
        for publisher in recording.student_endpoints(Kind.PUBLISHER)
        if publisher.node == node
    }
    received_ns = (recording.on(topic)[0].received_ns for topic in topics if recording.on(topic))
    return min(received_ns, default=None)


def _spinning_since_ns(recording: Recording, node: str, process: str) -> int:
    """When an executor began to spin, or answered; 0 where nothing proves that it did.

    Before that, the constructor may wait for something. A node that never answers does not spin,
    even if its process declares that it does.
    """
    spun_ns = [item.time_ns for item in recording.declared("spin") if item.process == process]
    answered_ns = [
        call.answered_ns for call in _calls_to(recording, node) if call.answered_ns is not None
    ]
    if not spun_ns or not answered_ns:
        return 0
    return min(spun_ns + answered_ns)


def _held_until_ns(recording: Recording, process: str, since_ns: int) -> int:
    """Until when the tracer held a publisher that was not yet matched; 0 if it held none."""
    held_ns = (item.time_ns for item in recording.declared("held") if item.process == process)
    return max((time_ns for time_ns in held_ns if time_ns < since_ns + _MOST_HELD_NS), default=0)


def _answered_or_end_ns(recording: Recording, call: Call) -> int:
    return call.answered_ns or recording.stop_ns


def _wait_s(recording: Recording, call: Call) -> float:
    return (_answered_or_end_ns(recording, call) - call.requested_ns) / NS


def _own_wait_s(recording: Recording, call: Call) -> float:
    """How long a call waited, without what the machine took meanwhile."""
    return left_s(recording, call.requested_ns, _answered_or_end_ns(recording, call))


def _machine_made_late(recording: Recording, calls: _JudgedCalls, within_s: float) -> bool:
    """Whether few enough calls would be late if the machine had taken no time."""
    late = [call for call in calls.late if _own_wait_s(recording, call) > within_s]
    return len(late) <= calls.allowed_late


def _machine_took_the_time(observed: str) -> Finding:
    return Finding.undecided(f"{observed}, but the machine took the time from the process")


def _why_typically_late(
    recording: Recording, allowed_s: float | None, by_node: Sequence[_JudgedCalls]
) -> Finding | None:
    """Why the median of a node's answer times is too long, or None."""
    if allowed_s is None:
        return None
    for calls in by_node:
        median_s = median(_wait_s(recording, call) for call in calls.judged)
        if median_s <= allowed_s:
            continue
        observed = f"{code(calls.node)} answered after {format_duration(median_s)} (median)"
        if median(_own_wait_s(recording, call) for call in calls.judged) <= allowed_s:
            return _machine_took_the_time(observed)
        late = [call for call in calls.judged if _wait_s(recording, call) > allowed_s]
        cause = mistaken(
            "busy",
            f"{observed}: callbacks keep the executor busy most of the time",
            _evidence(recording, [replace(calls, late=late)]),
        )
        return at_its_place(cause, observed, slow_callback(recording))
    return None


def _why_late(recording: Recording, calls: _JudgedCalls, summary: str) -> Finding:
    """Why a node does not answer, or too late."""
    process = declarations.process_of(recording, calls.node)
    if process is not None and ended_early(recording, process):
        return why_it_exited(recording, process).after(summary)
    observed = summary
    published = sum(map(len, recording.messages.values()))
    if published:
        observed += f" while {counted(published, 'message was', 'messages were')} published"
    processes = () if process is None else (process,)
    not_spun = never_spun(Uncalled(recording, observed, (calls.node,), processes))
    if not_spun is not None:
        return not_spun
    stand = None if process is None else where_it_stands(recording, process.name)
    if stand is None:
        stand = slow_callback(recording, None if process is None else process.name)
    blocked = f"{observed}: something blocks the executor"
    cause = mistaken("blocked", blocked, _evidence(recording, [calls]))
    return at_its_place(cause, observed, stand)


def _judged_by_declarations(recording: Recording, names: Sequence[str]) -> Finding:
    """The finding where no call counts, from what the process declared."""
    ended = why_ended(recording)
    if ended is not None:
        return ended
    without_services = _without_services(recording, names)
    if without_services:
        # Only declarations would be left, and a process can declare anything.
        return _no_services(recording, without_services)
    if declarations.declares(recording, "spin") and declarations.declares(recording, "timer"):
        return Finding.as_asked(
            f"{codes(names)} answered no call that could be judged; the process declared a timer "
            "and that its executor spins"
        )
    return Finding.ours(
        f"no call to {codes(executor_services(name)[0] for name in names)} could be judged, of "
        f"{counted(len(recording.calls), 'call')} that the probe sent"
    )


def _without_services(recording: Recording, names: Iterable[str]) -> list[str]:
    """Nodes that were there for long, and had none of the services that every node has."""
    long_there = {
        node.name
        for node in recording.student_nodes
        if recording.stop_ns - node.appeared_ns > _LONG_NS
    }
    offered = {(service.node, service.name) for service in recording.services}
    return [
        name
        for name in names
        if name in long_there
        and not any((name, service) in offered for service in executor_services(name))
    ]


def _no_services(recording: Recording, nodes: Sequence[str]) -> Finding:
    library = worded("rclpy", "rclcpp")
    cause = mistaken(
        "no_services",
        f"{codes(nodes)} has none of the services {codes(EXECUTOR_SERVICES, 'and')} that "
        f"{library} makes for every node: nothing shows from outside whether its executor spins",
        Evidence(moments=nodes_seen(recording)),
    )
    return replace(cause, verdict=Verdict.MACHINE) if was_held_up(recording) else cause


def _summary(by_node: Iterable[_JudgedCalls], parameters: Responsive) -> str:
    return "; ".join(
        f"{code(calls.node)} answered {len(calls.judged) - len(calls.late)} of "
        f"{counted(len(calls.judged), 'call')} within {format_duration(parameters.within)}"
        for calls in by_node
    )


def _evidence(recording: Recording, by_node: Sequence[_JudgedCalls]) -> Evidence:
    late = [call for calls in by_node for call in calls.late]
    answered = [call for calls in by_node for call in calls.judged if call.answered_ns is not None]
    plot = Plot(
        title="Time until the service answered",
        x_label="time since launch (s)",
        y_label="time to the answer (s)",
        x=tuple(recording.since_launch_s(call.requested_ns) for call in answered),
        y=tuple(_wait_s(recording, call) for call in answered),
    )
    return Evidence(
        moments=tuple(
            moment(recording, "call that waited too long", call.requested_ns)
            for call in late[:_MOST_MOMENTS]
        ),
        plots=(plot,) if answered else (),
    )
