"""Why something that was asked of a node was not answered in time: one cause, the deepest."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from grader.checks.finding import Evidence, Moment
from grader.checks.wording import code
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_destroyed
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.no_server import Word, offered
from grader.diagnosis.process.blocked_executor import why_never_spun
from grader.diagnosis.process.process_exit import ended_early, exited, why_it_exited
from grader.diagnosis.process.raised import interrupted_place, parse_failures, student_place
from grader.measure import declarations
from grader.recording.interaction import executor_services
from grader.recording.model import NS, Process, Recording
from grader.spec.unit import format_duration
from grader.submission.record import SourceError

_MULTI = "MultiThreadedExecutor"
_LOG_LINES = 10
_ROUNDING_S = 1e-6
_NEVER_AWAITED = re.compile(r"RuntimeWarning: coroutine '([\w.<>]+)' was never awaited")


@dataclass(frozen=True)
class NoAnswer(Symptom[Cause]):
    """A call or a goal was not answered in time.

    Attributes:
        what: The symptom in words.
        name: Of the service or action.
        while_busy: What is said of an executor that is blocked, or does not tell; None for
            general words.
    """

    recording: Recording
    what: str
    server: Word
    name: str
    asked_ns: int
    within_s: float
    while_busy: Cause | None = None

    @property
    def node(self) -> str:
        """The node that offers it; a parameter service is named after its node."""
        own = offered(self.recording, self.server, self.name)
        return own[-1].node if own else self.name.rpartition("/")[0]

    @property
    def process(self) -> Process | None:
        """The process of the node, if it is known."""
        return declarations.process_of(self.recording, self.node)

    @property
    def spins(self) -> bool | None:
        """Whether the node's executor spins; None if the node was not asked."""
        return _spins(self.recording, self.node, self.asked_ns)

    @property
    def moment(self) -> Moment:
        """When it was asked."""
        when_s = self.recording.since_launch_s(self.asked_ns)
        return Moment("asked, not answered in time", when_s)

    @property
    def place(self) -> SourceError | None:
        """Where the process was when it was interrupted."""
        process = self.process
        return interrupted_place(self.recording, process.name) if process else None

    @property
    def where(self) -> str:
        """The same in words, with a space before."""
        return f" ({self.place.file}:{self.place.line})" if self.place else ""

    @property
    def evidence(self) -> Evidence:
        """Both."""
        return Evidence(moments=(self.moment,), places=(self.place,) if self.place else ())


def why_unanswered(
    recording: Recording,
    what: str,
    server: Word,
    name: str,
    asked_ns: int,
    within_s: float,
    while_busy: Cause | None = None,
) -> Cause:
    """Why an answer did not come in time."""
    return cause_of(NoAnswer(recording, what, server, name, asked_ns, within_s, while_busy))


@explanation(NoAnswer)
def process_gone(symptom: NoAnswer) -> Cause | None:
    """The process ended."""
    return why_gone(symptom.recording, symptom.what, symptom.node)


@explanation(NoAnswer)
def server_destroyed(symptom: NoAnswer) -> Cause | None:
    """The program destroyed its server."""
    own = offered(symptom.recording, symptom.server, symptom.name)
    server = f"the {symptom.server.noun} {code(symptom.name)}"
    return why_destroyed(symptom.recording, symptom.what, server, own)


@explanation(NoAnswer)
def no_cpu_time(symptom: NoAnswer) -> Cause | None:
    """The machine gave the process too little CPU time; an error, and never a lost point."""
    recording = symptom.recording
    return why_taken(recording, symptom.what, symptom.asked_ns, recording.stop_ns, symptom.within_s)


@explanation(NoAnswer)
def callback_raised(symptom: NoAnswer) -> Cause | None:
    """A callback raised an exception."""
    process = symptom.process
    if process is None:
        return None
    return why_raised(symptom.recording, symptom.what, symptom.asked_ns, (process,))


@explanation(NoAnswer)
def never_spun(symptom: NoAnswer) -> Cause | None:
    """rclpy.spin() is never called, or the node is not given to the executor that spins."""
    process = symptom.process
    if process is None:
        return None
    nodes, moments = (symptom.node,), (symptom.moment,)
    return why_never_spun(symptom.recording, symptom.what, nodes, (process,), moments)


@explanation(NoAnswer)
def busy_as_the_lesson_says(symptom: NoAnswer) -> Cause | None:
    """The executor is busy with another callback, such as the execute callback of a goal."""
    busy = symptom.while_busy
    if busy is None or symptom.spins:
        return None
    return replace(busy, observed=busy.observed + symptom.where, evidence=symptom.evidence)


@explanation(NoAnswer)
def blocked_executor(symptom: NoAnswer) -> Cause | None:
    """A callback does not return, and blocks the executor."""
    if symptom.spins is not False:
        return None
    return Cause(
        f"{symptom.what}: something blocks the executor{symptom.where}; the node's parameter "
        "services answer no call either",
        "A callback must return soon. Look for `while True`, time.sleep() or input() in it, "
        "and for a call() of another service, which waits for an answer that the same "
        "executor would have to take in: use call_async().",
        symptom.evidence,
    )


@explanation(NoAnswer, general=True)
def callback_does_not_answer(symptom: NoAnswer) -> Cause:
    """The callback does not come to its end, or waits for another one of its group."""
    spins = ", although the node's executor spins" if symptom.spins else ""
    return Cause(
        f"{symptom.what}{symptom.where}{spins}",
        "Does the callback come to its end and return the response? A callback that waits for "
        "another one of the same callback group waits for ever.",
        symptom.evidence,
    )


def why_gone(recording: Recording, what: str, node: str) -> Cause | None:
    """Why the process of a node ended early, or None if it did not."""
    process = declarations.process_of(recording, node)
    ended = exited(recording) if process is None else (process,)
    if ended and ended_early(recording, ended[0]):
        return why_it_exited(recording, ended[0]).after(what)
    return None


def why_taken(
    recording: Recording, what: str, begin_ns: int, end_ns: int, within_s: float
) -> Cause | None:
    """The machine's doing, if it took as much as something was too late; else None.

    An answer that never came was not due where the observation ended before its time.
    """
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    excess_s = (end_ns - begin_ns) / NS - within_s
    if excess_s < -_ROUNDING_S:
        ended = format_duration((end_ns - begin_ns) / NS)
        return Cause.to_repeat(f"{what}: the run ended {ended} later, before that was due")
    if stolen_s <= 0.0 or stolen_s < excess_s:
        return None
    return Cause.to_repeat(
        f"{what}, but the machine took {format_duration(stolen_s)} from the process meanwhile"
    )


def why_one_cpu(recording: Recording, what: str) -> Cause | None:
    """The cause if an executor of several threads has one only because the machine has one CPU."""
    spins = [item.data for item in recording.declared("spin")]
    alone = any(item.get("executor") == _MULTI and item.get("threads") == 1 for item in spins)
    one_cpu = recording.environment.get("cpus", "1") == "1"
    if not (alone and one_cpu and declarations.traced(recording)):
        return None
    return Cause(
        f"{what}: MultiThreadedExecutor() has as many threads as the machine has CPUs, and here "
        "that is one",
        "Say how many: MultiThreadedExecutor(num_threads=4).",
        ours=True,
    )


def why_raised(
    recording: Recording, what: str, begin_ns: int, processes: Iterable[Process] | None = None
) -> Cause | None:
    """An exception that a process printed and survived from a time on; None if there is none.

    Args:
        processes: Whose; by default all.
    """
    candidates = recording.processes if processes is None else processes
    found = (_why_raised_in(recording, what, begin_ns, process) for process in candidates)
    return next(filter(None, found), None)


def _why_raised_in(
    recording: Recording, what: str, begin_ns: int, process: Process
) -> Cause | None:
    lines = [
        line
        for line in recording.log
        if line.process == process.name
        and line.stream == "stderr"
        and begin_ns <= line.time_ns <= recording.stop_ns
    ]
    found = [item for item in parse_failures([line.text for line in lines]) if not item.ignored]
    if not found:
        return None
    place = student_place(found[-1], recording.submission)
    where = f" ({place.file}:{place.line})" if place else ""
    return Cause(
        f"{what}: an exception was raised meanwhile, {found[-1]}{where}",
        "Correct the line that is named here."
        if place
        else "Read the traceback from its last line.",
        Evidence(
            moments=(Moment("the exception", recording.since_launch_s(lines[-1].time_ns)),),
            places=(place,) if place else (),
            log=tuple(line.text for line in lines[-_LOG_LINES:]),
        ),
    )


def why_never_awaited(recording: Recording, what: str) -> Cause | None:
    """A coroutine that was made but never run, as Python warns; None without such a warning."""
    for line in recording.log:
        found = _NEVER_AWAITED.search(line.text) if line.stream == "stderr" else None
        if found:
            name = found[1].rpartition(".")[2]
            return Cause(
                f"{what}: Python warns that the coroutine {code(found[1])} was never awaited, so "
                "nothing of it ran",
                f"A function that begins with `async def` runs only under await: await "
                f"self.{name}(...). Where nothing is awaited in it, write def instead of async def "
                "(an EventsExecutor awaits no callback of a subscription).",
                Evidence(
                    moments=(Moment("the warning", recording.since_launch_s(line.time_ns)),),
                    log=(line.text,),
                ),
            )
    return None


def _spins(recording: Recording, node: str, asked_ns: int) -> bool | None:
    """Whether the node answered what its executor answers, from a time on; None if not asked."""
    calls = [
        call
        for call in recording.calls
        if call.service in executor_services(node)
        and asked_ns <= call.requested_ns <= recording.stop_ns - NS
    ]
    answered = any(call.answered_ns is not None and call.answered_ns > asked_ns for call in calls)
    return answered if calls else None
