"""Why something that was asked of a node was not answered in time: one cause, the deepest."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from grader.checks import declarations
from grader.checks.finding import Evidence, Moment
from grader.checks.wording import code
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_destroyed
from grader.diagnosis.no_server import Word, offered
from grader.diagnosis.process.blocked_executor import why_never_spun
from grader.diagnosis.process.process_exit import ended_early, exited, why_it_exited
from grader.diagnosis.process.raised import interrupted_place, parse_failures, student_place
from grader.recording.interaction import executor_services
from grader.recording.model import NS, Process, Recording
from grader.spec.unit import format_duration

_MULTI = "MultiThreadedExecutor"
_LOG_LINES = 10
_ROUNDING_S = 1e-6
_NEVER_AWAITED = re.compile(r"RuntimeWarning: coroutine '([\w.<>]+)' was never awaited")


def why_unanswered(
    recording: Recording,
    what: str,
    server: Word,
    name: str,
    asked_ns: int,
    within_s: float,
    while_busy: Cause | None = None,
) -> Cause:
    """Why an answer did not come in time.

    Args:
        while_busy: What is said of an executor that is blocked, or does not tell; by
            default in general words.
    """
    own = offered(recording, server, name)
    # A parameter service is named after its node.
    node = own[-1].node if own else name.rpartition("/")[0]
    process = declarations.process_of(recording, node)
    moment = Moment("asked, not answered in time", recording.since_launch_s(asked_ns))
    cause = (
        why_gone(recording, what, node)
        or why_destroyed(recording, what, f"the {server.noun} {code(name)}", own)
        or why_taken(recording, what, asked_ns, recording.stop_ns, within_s)
    )
    if cause is None and process is not None:
        cause = why_raised(recording, what, asked_ns, (process,)) or why_never_spun(
            recording, what, (node,), (process,), (moment,)
        )
    if cause is not None:
        return cause
    spins = _spins(recording, node, asked_ns)
    place = interrupted_place(recording, process.name) if process else None
    where = f" ({place.file}:{place.line})" if place else ""
    evidence = Evidence(moments=(moment,), places=(place,) if place else ())
    if while_busy is not None and not spins:
        return replace(while_busy, observed=while_busy.observed + where, evidence=evidence)
    if spins is False:
        return Cause(
            f"{what}: something blocks the executor{where}; the node's parameter "
            "services answer no call either",
            "A callback must return soon. Look for `while True`, time.sleep() or input() in it, "
            "and for a call() of another service, which waits for an answer that the same "
            "executor would have to take in: use call_async().",
            evidence,
        )
    return Cause(
        f"{what}{where}" + (", although the node's executor spins" if spins else ""),
        "Does the callback come to its end and return the response? A callback that waits for "
        "another one of the same callback group waits for ever.",
        evidence,
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
