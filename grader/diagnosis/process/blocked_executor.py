"""Whether something blocks an executor, as the node's own services tell."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace

from grader.diagnosis.process.standing import (
    Stand,
    slow_callback,
    unkept_future,
    where_it_stands,
)
from grader.findings.finding import Evidence, Finding, Moment
from grader.findings.first_seen import until_the_end
from grader.findings.wording import codes
from grader.findings.words import SPIN, SPIN_NODE
from grader.measure import declarations
from grader.recording.model import NS, Call, Process, Recording
from grader.spec.unit import format_duration

# A call with less time for an answer than this may be unanswered for that reason.
_ANSWER_S = 1.0
# A node whose callbacks return at once answers a call to its parameter services sooner.
_SLOW_S = 0.5


def blocked_hint() -> str:
    """What to try where something blocks the executor."""
    return (
        f"A callback must return soon, and main() must come to {SPIN_NODE}. Look for a loop, a "
        "sleep or a call that waits."
    )


def left_s(recording: Recording, begin_ns: int, end_ns: int) -> float:
    """Time without what the machine took of it."""
    return (end_ns - begin_ns) / NS - recording.stolen_s(begin_ns, end_ns)


def why_not_called(recording: Recording, seen: str, nodes: Collection[str]) -> Finding | None:
    """The cause if callbacks are not called, or late; None where nothing tells of it."""
    return (
        why_never_spun(recording, seen, nodes)
        or why_blocked(recording, seen, nodes, recording.launched_ns)
        or why_slow(recording, seen, nodes)
    )


def why_blocked(
    recording: Recording, seen: str, nodes: Collection[str], since_ns: int
) -> Finding | None:
    """The cause if an executor is blocked, as calls to its node tell that had time for an answer.

    A node's parameter services answer only while its executor spins. What the machine took from
    the node is no time for an answer, and so a node that only gets no CPU is never blocked.
    """
    calls = [
        call
        for call in _calls(recording, nodes)
        if left_s(recording, call.requested_ns, recording.stop_ns) >= _ANSWER_S
    ]
    call = next((call for call in calls if call.answered_ns is None), None)
    if call is None or any((one.answered_ns or 0) >= since_ns for one in calls):
        return None
    process = declarations.process_of(recording, min(nodes))
    stand = where_it_stands(recording, process.name) if process is not None else None
    stand = stand or unkept_future(recording)
    since_s = recording.since_launch_s(call.requested_ns)
    cause = Finding(
        f"{seen}: something blocks the executor; from {since_s:.2f} s after launch on the node's "
        "parameter service does not answer either",
        blocked_hint(),
        Evidence(moments=(Moment("first call that was not answered", since_s),)),
        concept="executors",
    )
    return cause if stand is None else at_its_place(cause, seen, stand)


def at_its_place(cause: Finding, seen: str, stand: Stand) -> Finding:
    """A cause that names the line which keeps the program."""
    evidence = replace(cause.evidence, places=(stand.place,))
    return replace(cause, observed=f"{seen}: {stand.words}", hint=stand.hint, evidence=evidence)


def why_slow(recording: Recording, seen: str, nodes: Collection[str]) -> Finding | None:
    """The cause if callbacks keep each other waiting for long, as late answers to calls tell."""
    waits = [
        (call, left_s(recording, call.requested_ns, call.answered_ns or recording.stop_ns))
        for call in _calls(recording, nodes)
    ]
    # The longest but one: a single answer may have been lost on its way.
    call, wait_s = sorted(waits, key=lambda item: item[1])[-2] if len(waits) > 1 else (None, 0.0)
    if call is None or wait_s <= _SLOW_S:
        return None
    moment = Moment("call that waited", recording.since_launch_s(call.requested_ns))
    stand = slow_callback(recording)
    cause = Finding(
        f"{seen}: the callbacks keep each other waiting, and calls to the node's parameter "
        f"service waited {format_duration(wait_s)} or more",
        blocked_hint(),
        Evidence(moments=(moment,)),
        concept="executors",
    )
    return cause if stand is None else at_its_place(cause, seen, stand)


def why_never_spun(
    recording: Recording,
    seen: str,
    nodes: Iterable[str] = (),
    processes: Iterable[Process] | None = None,
) -> Finding | None:
    """The cause if nothing spins a node, as its process declares.

    Args:
        processes: Which may be the one that never spun; by default all.
    """
    candidates = recording.processes if processes is None else processes
    process = next(
        (item for item in candidates if declarations.never_spun(recording, item.name)), None
    )
    names = sorted(set(nodes))
    if process is None:
        if not names or not all(declarations.in_no_executor(recording, name) for name in names):
            return None
        return Finding(
            f"{seen}: an executor spins, but {codes(names)} was not added to it, so none of its "
            "callbacks runs",
            "Add the node to the executor that spins, executor.add_node(node), or call "
            f"{SPIN_NODE}.",
            Evidence(moments=(until_the_end(recording, "no executor had the node"),)),
            concept="executors",
        )
    stand = where_it_stands(recording, process.name)
    cause = Finding(
        f"{seen}: {SPIN} was never called, so no callback runs",
        f"Call {SPIN_NODE} in main(). Nothing before it may wait or loop for ever.",
        Evidence(moments=(until_the_end(recording, f"{SPIN} was still not called"),)),
        concept="executors",
    )
    return cause if stand is None else at_its_place(cause, seen, stand)


def _calls(recording: Recording, nodes: Collection[str]) -> list[Call]:
    """Calls to services of the nodes that found a server."""
    return [
        call
        for call in recording.calls
        if call.service.rpartition("/")[0] in nodes and not call.error
    ]
