"""Why no callback is called, or late: nothing spins, or something blocks the executor."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

from grader.diagnosis.explanation import explanation, remedy
from grader.diagnosis.process.process_exit import NotDone, process_ended
from grader.diagnosis.process.raised import in_brackets, own_frames, raised_at
from grader.diagnosis.process.standing import Stand, slow_callback, unkept_future, where_it_stands
from grader.diagnosis.process.tracebacks import parse_failures
from grader.findings.finding import Evidence, Finding, evidence_at, moment, until_the_end
from grader.findings.words import SPIN, codes
from grader.measure import declarations
from grader.recording.interaction import executor_services
from grader.recording.model import NS, Call, Process, Recording
from grader.spec.unit import format_duration

# A call with less time for an answer than this may be unanswered for that reason.
ANSWER_S = 1.0
# A node whose callbacks return at once answers a call to its parameter services sooner.
_SLOW_S = 0.5
# Share of the time that the host may take before what is missing proves nothing.
_STARVED = 0.5
_LOG_LINES = 10


def left_s(recording: Recording, begin_ns: int, end_ns: int) -> float:
    """Time without what the machine took of it."""
    return (end_ns - begin_ns) / NS - recording.stolen_s(begin_ns, end_ns)


def held_up_below(
    recording: Recording, seen: str, number: int, needed: int, span_ns: tuple[int, int]
) -> Finding | None:
    """The machine's doing, if with the time that it took there may have been as many as needed."""
    begin_ns, end_ns = span_ns
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    if stolen_s <= 0.0:
        return None
    # At the same rate in the whole of the time.
    is_enough = number * (end_ns - begin_ns) / NS >= needed * left_s(recording, begin_ns, end_ns)
    return Finding.held_up(seen, stolen_s) if is_enough else None


@dataclass(frozen=True)
class NotCalled(NotDone, concept="executors"):
    """No callback is called, whatever was waited for: messages, answers, requests, log lines."""

    @property
    def needs_spin(self) -> bool:
        """Whether an executor must have called a callback for what is missing."""
        return True

    @property
    def nodes(self) -> Collection[str]:
        """Those with the callbacks, as far as they are known."""
        return ()

    @property
    def processes(self) -> Sequence[Process]:
        """Those that may never have spun."""
        return self.recording.processes

    @property
    def unanswered(self) -> str:
        """The service or action whose answer is missing; it is no second proof of that."""
        return ""

    @property
    def since_ns(self) -> int:
        """From when on the executor must not have answered anything."""
        return self.recording.launched_ns

    @property
    def excuse(self) -> Finding | None:
        """The machine's doing, if it may explain what is missing; by default it never does."""
        return None

    def starved(self, begin_ns: int, end_ns: int) -> Finding | None:
        """The machine's doing, if it took so much of a time that nothing is proven by it."""
        stolen_s = self.recording.stolen_s(begin_ns, end_ns)
        if stolen_s <= _STARVED * (end_ns - begin_ns) / NS:
            return None
        guilty = self.guilty()
        if guilty is not None:
            return guilty.doubted()
        return Finding.held_up(self.seen, stolen_s)

    def guilty(self) -> Finding | None:
        """What is wrong although the machine took time, if that shows."""
        # A callback that never returns burns what CPU the machine leaves it.
        return blocked_executor(self)

    def placed(self, cause: Finding) -> Finding:
        """A cause with the line at which a process did not go on, if one did not."""
        for process in self.processes:
            stand = where_it_stands(self.recording, process.name)
            if stand is not None:
                return at_its_place(cause, cause.observed, stand)
        return cause


class CalledLate(NotCalled, concept="executors"):
    """Callbacks are called late or not at all."""

    @property
    def late(self) -> str:
        """What is missing or late, in words."""
        return self.seen


@dataclass(frozen=True)
class Uncalled(CalledLate):
    """A callback did not do what a check waited for."""

    what: str
    of_nodes: Collection[str] = ()
    of_processes: Sequence[Process] | None = None

    @property
    def seen(self) -> str:
        """What is missing, in words."""
        return self.what

    @property
    def nodes(self) -> Collection[str]:
        """Those with the callbacks, as far as they are known."""
        return self.of_nodes

    @property
    def processes(self) -> Sequence[Process]:
        """Those that may never have spun; by default all."""
        return self.recording.processes if self.of_processes is None else self.of_processes


@explanation(NotCalled, after=(process_ended,))
def no_cpu_time(symptom: NotCalled) -> Finding | None:
    """The machine gave the process too little CPU time; this is an error and costs no points."""
    return symptom.excuse


@explanation(NotCalled)
def callback_raised(symptom: NotCalled) -> Finding | None:
    """A callback raised an exception, and the process went on."""
    return why_raised(symptom.recording, symptom.seen, symptom.since_ns, symptom.processes)


@explanation(NotCalled)
def never_spun(symptom: NotCalled) -> Finding | None:
    """rclpy.spin() is never called, or the node is not given to the executor that spins."""
    recording = symptom.recording
    if not symptom.needs_spin:
        return None
    for process in symptom.processes:
        if declarations.never_spun(recording, process.name):
            cause = Finding(
                f"{symptom.seen}: {SPIN} was never called, so no callback runs",
                remedy("never_spun"),
                Evidence(moments=(until_the_end(recording, f"{SPIN} was still not called"),)),
                concept="executors",
            )
            return at_its_place(cause, symptom.seen, where_it_stands(recording, process.name))
    nodes = sorted(set(symptom.nodes))
    if not nodes or not all(declarations.in_no_executor(recording, node) for node in nodes):
        return None
    return Finding(
        f"{symptom.seen}: an executor spins, but {codes(nodes)} was not added to it, so none of "
        "its callbacks runs",
        remedy("in_no_executor"),
        Evidence(moments=(until_the_end(recording, "no executor had the node"),)),
        concept="executors",
    )


@explanation(NotCalled)
def blocked_executor(symptom: NotCalled) -> Finding | None:
    """A callback does not return, and blocks the executor."""
    # A node's parameter services answer only while its executor spins. What the machine took from
    # the node is no time for an answer, and so a node that only gets no CPU is never blocked.
    recording = symptom.recording
    calls = [
        call
        for call in _calls(symptom)
        if left_s(recording, call.requested_ns, recording.stop_ns) >= ANSWER_S
    ]
    unanswered = [call for call in calls if call.answered_ns is None]
    if not unanswered or any((call.answered_ns or 0) >= symptom.since_ns for call in calls):
        return None
    call = unanswered[0]
    process = declarations.process_of(recording, min(symptom.nodes))
    since_s = recording.since_launch_s(call.requested_ns)
    cause = Finding(
        f"{symptom.seen}: something blocks the executor; from {since_s:.2f} s after launch on the "
        "node's parameter service does not answer either",
        remedy("blocked"),
        evidence_at(recording, "first call that was not answered", call.requested_ns),
        concept="executors",
    )
    stand = where_it_stands(recording, process.name) if process is not None else None
    return at_its_place(cause, symptom.seen, stand or unkept_future(recording))


@explanation(CalledLate)
def slow_callbacks(symptom: CalledLate) -> Finding | None:
    """Callbacks keep each other waiting for long."""
    recording = symptom.recording
    waits = [
        (call, left_s(recording, call.requested_ns, call.answered_ns or recording.stop_ns))
        for call in _calls(symptom)
    ]
    if len(waits) < 2:
        return None
    # The longest but one: a single answer may have been lost on its way.
    call, wait_s = sorted(waits, key=lambda item: item[1])[-2]
    if wait_s <= _SLOW_S:
        return None
    cause = Finding(
        f"{symptom.late}: the callbacks keep each other waiting, and calls to the node's parameter "
        f"service waited {format_duration(wait_s)} or more",
        remedy("blocked"),
        evidence_at(recording, "call that waited", call.requested_ns),
        concept="executors",
    )
    return at_its_place(cause, symptom.late, slow_callback(recording))


def why_raised(
    recording: Recording, what: str, begin_ns: int, processes: Iterable[Process] | None = None
) -> Finding | None:
    """An exception that a process printed and survived from a time on; None if there is none.

    Args:
        processes: Whose; by default all.
    """
    for process in recording.processes if processes is None else processes:
        lines = [
            line
            for line in recording.log
            if line.process == process.name
            and line.stream == "stderr"
            and begin_ns <= line.time_ns <= recording.stop_ns
        ]
        texts = [line.text for line in lines]
        raised = [failure for failure in parse_failures(texts) if not failure.ignored]
        if not raised:
            continue
        place = raised_at(raised[-1], recording)
        return Finding(
            f"{what}: an exception was raised meanwhile, {raised[-1]}{in_brackets(place)}",
            remedy("named_line" if place else "read_message"),
            Evidence(
                moments=(moment(recording, "the exception", lines[-1].time_ns),),
                places=(place,) if place else (),
                log=tuple(own_frames(texts, recording.submission)[-_LOG_LINES:]),
            ),
        )
    return None


def at_its_place(cause: Finding, seen: str, stand: Stand | None) -> Finding:
    """A cause that names the line which keeps the program, if that is known."""
    if stand is None:
        return cause
    evidence = replace(cause.evidence, places=(stand.place,))
    return replace(cause, observed=f"{seen}: {stand.words}", hint=stand.hint, evidence=evidence)


def _calls(symptom: NotCalled) -> list[Call]:
    """Calls to the services that rclpy and rclcpp make for the nodes, which found a server."""
    services = {name for node in symptom.nodes for name in executor_services(node)}
    services.discard(symptom.unanswered)
    return [call for call in symptom.recording.calls if call.service in services and not call.error]
