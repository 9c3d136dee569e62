"""Checks of the executor: whether callbacks block it, and whether a timer calls what publishes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from statistics import median

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Doubt
from grader.checks.node.node import target_nodes
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.not_called import (
    Uncalled,
    at_its_place,
    left_s,
    never_spun,
)
from grader.diagnosis.process.process_exit import ended_early, why_ended, why_it_exited
from grader.diagnosis.process.standing import slow_callback, where_it_stands
from grader.diagnosis.undeclared import why_undeclared
from grader.findings.finding import (
    Evidence,
    Finding,
    Plot,
    Verdict,
    evidence_at,
    first_seen,
    moment,
    nodes_seen,
)
from grader.findings.words import SPIN_NODE, code, codes, counted, worded
from grader.measure import callback_runs, declarations
from grader.measure.declarations import was_held_up
from grader.measure.paused import paused, publishers
from grader.recording.interaction import EXECUTOR_SERVICES, executor_services
from grader.recording.model import NS, Call, Kind, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

_FORGIVING_FROM = 3
_MOST_MOMENTS = 5
_LONG_NS = NS
_MOST_HELD_NS = 3 * NS
"""Longer than the tracer holds a publisher; a process could declare any time."""
# How the tracer names a callback that is None: create_rate() makes a timer that calls nothing.
_NOTHING = "NoneType"
_CALLED_NOTHING = "rosgrade let the executor call nothing"


class Responsive(Parameters):
    """Parameters of executor.responsive."""

    about = ("timer", "subscription")
    doubt = Doubt.ANSWER_MISSED

    within: Duration = Field(1.0, description="Longest time for an answer.")
    typically: Duration | None = Field(
        None,
        description="Longest median of the answer times; by default any.",
    )

    def _asked(self) -> str:
        text = f"services of the node answer within {format_duration(self.within)}"
        if self.typically is not None:
            text += f", the median within {format_duration(self.typically)}"
        return text


@dataclass(frozen=True)
class _Answers:
    """Calls to one node, and those of them that were not answered in time."""

    node: str
    judged: list[Call]
    late: list[Call]

    def enough(self, late: int) -> bool:
        """Whether so many late calls are allowed: a tenth, or one of a few."""
        number = len(self.judged)
        return late <= max(number // 10, number >= _FORGIVING_FROM)


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
    names = [one.name for one in target_nodes(recording) or recording.student_nodes]
    groups = [_answers(recording, name, parameters) for name in dict.fromkeys(names)]
    groups = [group for group in groups if group.judged]
    if not groups:
        return _unasked(recording, names, parameters)
    bad = [group for group in groups if not group.enough(len(group.late))]
    if not bad:
        stop_if(_why_mostly_late(recording, parameters, groups))
        summary = _summary(groups, parameters)
        return Finding.as_asked(summary, _evidence(recording, groups))
    # Of the late calls, those that were late for another reason than what the host took.
    own = [sum(_own_s(recording, call) > parameters.within for call in one.late) for one in bad]
    if all(one.enough(late) for one, late in zip(bad, own, strict=True)):
        return Finding.undecided(
            f"{_summary(bad, parameters)}, but the machine took the time from the process"
        )
    worst = max(bad, key=lambda group: len(group.late) / len(group.judged))
    return _why_late(recording, worst, parameters)


def _answers(recording: Recording, node: str, parameters: Responsive) -> _Answers:
    within_ns = int(parameters.within * NS)
    begin_ns = _working_from(recording, node)
    judged, late = [], []
    own = {item.name for item in recording.services if item.node == node}
    others = {item.name for item in recording.services if item.node != node} - own
    for call in recording.calls:
        # An answer in its place, by a service of another node's, says nothing of this one.
        if call.service not in executor_services(node) or call.service in others:
            continue
        answered = call.answered_ns is not None and _wait_s(recording, call) <= parameters.within
        # An answer in time is one, however late or early it was asked for.
        if answered or begin_ns <= call.requested_ns <= recording.stop_ns - within_ns:
            judged.append(call)
            late += [] if answered else [call]
    return _Answers(node, judged, late)


def _working_from(recording: Recording, node: str) -> int:
    """When a node began to publish, or when it was left to itself if it publishes nothing."""
    topics = {
        item.topic for item in recording.student_endpoints(Kind.PUBLISHER) if item.node == node
    }
    stamps = [recording.on(topic)[0].received_ns for topic in topics if recording.on(topic)]
    if stamps:
        return min(stamps)
    appeared = [item.appeared_ns for item in recording.student_nodes if item.name == node]
    begin_ns = min(appeared or [recording.launched_ns])
    process = declarations.process_of(recording, node)
    if process is None:
        return begin_ns
    # Before an executor spins the constructor may wait for something. A node that never answers
    # does not spin, even if its process declares that it does.
    spun = [item.time_ns for item in recording.declared("spin") if item.process == process.name]
    answered = [
        call.answered_ns
        for call in recording.calls
        if call.service in executor_services(node) and call.answered_ns is not None
    ]
    if spun and answered:
        begin_ns = max(begin_ns, min(*spun, *answered))
    # The tracer held its first publisher until it had matched; one of another type never does.
    held = [item.time_ns for item in recording.declared("held") if item.process == process.name]
    return max([begin_ns, *(time_ns for time_ns in held if time_ns < begin_ns + _MOST_HELD_NS)])


def _wait_s(recording: Recording, call: Call) -> float:
    return ((call.answered_ns or recording.stop_ns) - call.requested_ns) / NS


def _own_s(recording: Recording, call: Call) -> float:
    """How long a call waited, without what the machine took meanwhile."""
    return left_s(recording, call.requested_ns, call.answered_ns or recording.stop_ns)


def _why_mostly_late(
    recording: Recording, parameters: Responsive, groups: list[_Answers]
) -> Finding | None:
    """Why a node answers in time, but mostly late; or None."""
    allowed_s = parameters.typically
    for group in groups:
        median_s = median(_wait_s(recording, call) for call in group.judged)
        if allowed_s is None or median_s <= allowed_s:
            continue
        observed = f"{code(group.node)} answered after {format_duration(median_s)} (median)"
        if median(_own_s(recording, call) for call in group.judged) <= allowed_s:
            return Finding.undecided(f"{observed}, but the machine took the time from the process")
        late = [call for call in group.judged if _wait_s(recording, call) > allowed_s]
        shown = _evidence(recording, [_Answers(group.node, group.judged, late)])
        seen = f"{observed}: callbacks keep the executor busy most of the time"
        cause = mistaken("busy", seen, shown)
        return at_its_place(cause, observed, slow_callback(recording))
    return None


def _why_late(recording: Recording, group: _Answers, parameters: Responsive) -> Finding:
    """Why a node does not answer, or too late."""
    process = declarations.process_of(recording, group.node)
    seen = _summary([group], parameters)
    if process is not None and ended_early(recording, process):
        return why_it_exited(recording, process).after(seen)
    number = sum(len(found) for found in recording.messages.values())
    meanwhile = f" while {counted(number, 'message was', 'messages were')} published"
    seen += meanwhile if number else ""
    evidence = _evidence(recording, [group])
    processes = () if process is None else (process,)
    stop_if(never_spun(Uncalled(recording, seen, (group.node,), processes)))
    name = process.name if process else None
    stand = where_it_stands(recording, name) if name else None
    stand = stand or slow_callback(recording, name)
    cause = mistaken("blocked", f"{seen}: something blocks the executor", evidence)
    return at_its_place(cause, seen, stand)


def _unasked(recording: Recording, names: list[str], parameters: Responsive) -> Finding:
    """The finding where no call counts, from what the process declared."""
    stop_if(why_ended(recording))
    # In this time the graph tells which services a node has, several times over.
    seen = {
        item.name
        for item in recording.student_nodes
        if recording.stop_ns - item.appeared_ns > _LONG_NS
    }
    offered = {(service.node, service.name) for service in recording.services}
    lacking = [
        name
        for name in names
        if name in seen and offered.isdisjoint((name, one) for one in executor_services(name))
    ]
    if lacking:
        # Only declarations would be left, and a process can declare anything.
        busy, library = was_held_up(recording), worded("rclpy", "rclcpp")
        found = mistaken(
            "no_services",
            f"{codes(lacking)} has none of the services "
            f"{codes(EXECUTOR_SERVICES, 'and')} that {library} makes for every node: "
            "nothing shows from outside whether its executor spins",
            Evidence(moments=nodes_seen(recording)),
        )
        return replace(found, verdict=Verdict.MACHINE) if busy else found
    if declarations.declares(recording, "spin") and declarations.declares(recording, "timer"):
        return Finding.as_asked(
            f"{codes(names)} answered no call that could be judged; the process declared a timer "
            "and that its executor spins"
        )
    return Finding.ours(
        f"no call to {codes(executor_services(name)[0] for name in names)} could be judged, of "
        f"{counted(len(recording.calls), 'call')} that the probe sent",
    )


def _summary(groups: list[_Answers], parameters: Responsive) -> str:
    return "; ".join(
        f"{code(group.node)} answered {len(group.judged) - len(group.late)} of "
        f"{counted(len(group.judged), 'call')} within {format_duration(parameters.within)}"
        for group in groups
    )


def _evidence(recording: Recording, groups: list[_Answers]) -> Evidence:
    late = [call for group in groups for call in group.late]
    answered = [call for group in groups for call in group.judged if call.answered_ns is not None]
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


class Timer(Parameters):
    """Parameters of executor.timer."""

    about = ("timer", "publisher")
    doubt = Doubt.ANSWER_MISSED
    pauses = True

    asks = "a timer whose callback publishes on `{self.topic}`"

    topic: TopicName = Field(description="Topic on which the callback of a timer publishes.")


@check("executor.timer", Subject.RECORDING, Timer, concept="timers")
def timer(recording: Recording, parameters: Timer) -> Finding:
    """The process has a timer.

    A thread that sleeps and publishes looks like a timer. So, for a moment after the run, the
    executors find nothing ready and call no callback. If a message is published in this moment, it
    does not come from a callback, whatever the process declares. The process must also have
    declared its publisher and a timer with a callback, of any period.
    """
    messages = recording.on(parameters.topic)
    if not messages:
        return why_silent(recording, parameters.topic)
    if not declarations.declares(recording, "publisher", topic=parameters.topic):
        return why_undeclared(recording, f"the publisher on {code(parameters.topic)}")
    timers = declarations.timers(recording)
    calling = [item for item in timers if item.callback != _NOTHING]
    number = f"{counted(len(messages), 'message was', 'messages were')} published"
    if calling and recording.pauses:
        stop_if(_why_uncalled(recording, parameters.topic))
    if declarations.not_in_callback(recording, parameters.topic):
        observed = f"{number}, outside of every callback: a thread or a loop calls publish()"
    elif calling:
        name = f", which calls {code(calling[0].callback)}" if calling[0].callback else ""
        rest = f", and nothing was published while {_CALLED_NOTHING}"
        seen = rest if recording.pauses and publishers(recording, parameters.topic) else ""
        return Finding.as_asked(
            f"the process declared a timer of {format_duration(calling[0].period_s)}{name}{seen}",
            evidence_at(recording, "timer created", calling[0].declared_ns),
        )
    elif declarations.timer_of_zero(recording):
        return Finding.as_asked("the process declared a timer")
    else:
        rate = " but that of a rate, which calls nothing" if timers else ""
        observed = (
            f"{number}, but the process declared no timer{rate}: something else calls publish(), "
            "such as a thread or a loop"
        )
    evidence = Evidence(moments=first_seen(recording, messages))
    return mistaken("no_timer", observed, evidence)


def _why_uncalled(recording: Recording, topic: str) -> Finding | None:
    """Why it is no timer that publishes, from what came while no executor called anything."""
    found = paused(recording, topic)
    if found is None:
        return _why_not_paused(recording, topic)
    if not found.uncalled_ns:
        if found.covers(recording, topic) or callback_runs.publishes(recording, topic):
            return None
        return Finding.ours(
            f"the messages on {code(topic)} are too far apart to see in the pause after the run "
            "whether a callback publishes them",
            disturbed=was_held_up(recording),
        )
    number = counted(len(found.uncalled_ns), "message was", "messages were")
    observed = f"{number} published outside of every callback, while {_CALLED_NOTHING}"
    if found.is_doubtful(recording):
        return Finding.undecided(f"{observed}, but the machine held messages up")
    label = "published outside of every callback"
    shown = evidence_at(recording, label, found.uncalled_ns[0])
    return mistaken("no_timer", f"{observed}: a thread or a loop calls publish()", shown)


def _why_not_paused(recording: Recording, topic: str) -> Finding | None:
    """Why a process that publishes did not pause, where that is not right."""
    publish = {
        one.process
        for one in recording.declared("publisher")
        if one.data.get("topic") == topic and not declarations.is_compiled(recording, one.process)
    }
    has_ended = not publishers(recording, topic)
    seen = (
        "the program ended"
        if has_ended
        else "after the run no executor of the process waited for work when it was asked to"
    )
    # An executor of another kind may call callbacks as well.
    uncalled = [
        one
        for one in recording.processes
        if one.name in publish and not declarations.declares(recording, "ran", one.name)
    ]
    stop_if(never_spun(Uncalled(recording, seen, (), uncalled)))
    if has_ended:
        if callback_runs.publishes(recording, topic):
            return None
        return Finding.ours(
            f"{seen} before it could be judged whether a callback publishes",
            f"Let {SPIN_NODE} run until Ctrl+C ends it.",
        )
    if not declarations.declares(recording, "spin"):
        return Finding.ours(f"{seen}: rosgrade does not know its kind")
    shown = Evidence(moments=first_seen(recording, recording.on(topic)))
    found = mistaken("never_waits", seen, shown)
    return found.doubted(was_held_up(recording))
