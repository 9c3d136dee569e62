"""What the student's processes declared of themselves through the tracer.

Nothing here may be used where DDS can tell. Absence means something only in a process that the
tracer was in (:func:`traced`). Every value is read as hostile: the student's process could have
written the line itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from grader.measure.compatibility import STRENGTH
from grader.recording.model import NS, Declaration, Kind, Process, Qos, Recording

# Announcements are repeated: only a machine that is busy for longer makes all of them get lost.
_LOST_S = 0.5
# What only a function's own variables hold is gone sooner.
_MOMENT_S = 1.0


@dataclass(frozen=True)
class DeclaredTimer:
    """A timer as the process created it."""

    period_s: float
    declared_ns: int
    callback: str = ""


@dataclass(frozen=True)
class DeclaredQueue:
    """History and depth of an endpoint as the process declared them; None for no number."""

    history: str
    depth: int | None


def traced(recording: Recording, process: str | None = None) -> bool:
    """Whether the tracer was in the process (or, without a name, in all of them)."""
    started = {item.process for item in recording.declared("started")}
    if process is not None:
        return process in started
    return bool(started) and all(item.name in started for item in recording.processes)


def is_compiled(recording: Recording, process: str) -> bool:
    """Whether a process is no Python program: as its tracer says, or how its package is built."""
    began = [item for item in recording.declared("started") if item.process == process]
    if began:
        return any("language" in item.data for item in began)
    package = recording.submission.package(process.partition("/")[0])
    return package is not None and package.build_type == "ament_cmake"


def hides_calls(recording: Recording) -> bool:
    """Whether an EventsExecutor of rclpy spins: it calls from C++, where no tracer in Python is."""
    return any(
        item.data.get("executor") == "EventsExecutor" and not is_compiled(recording, item.process)
        for item in recording.declared("spin")
    )


def declares(recording: Recording, kind: str, process: str | None = None, **texts: str) -> bool:
    """Whether a process (or any) declared something, such as a ``publisher`` on a ``topic``."""
    return any(
        process in (None, item.process)
        and all(_text(item.data, key) == value for key, value in texts.items())
        for item in recording.declared(kind)
    )


def never_spun(recording: Recording, process: str | None = None) -> bool:
    """Whether the tracer was there and no executor ever waited for work.

    `ros2 launch` spins nothing itself: its nodes are in processes of their own.
    """
    has_nodes = declares(recording, "node", process) or not declares(recording, "node")
    return has_nodes and traced(recording, process) and not declares(recording, "spin", process)


def executors(recording: Recording) -> tuple[tuple[str, int], ...]:
    """Executors that were spun, each with its number of threads."""
    found = []
    for item in recording.declared("spin"):
        name, number = item.data.get("executor"), item.data.get("threads")
        if isinstance(name, str) and isinstance(number, int):
            found.append((name, number))
    return tuple(dict.fromkeys(found))


def in_no_executor(recording: Recording, node: str) -> bool:
    """Whether the process of a node spun, but gave this node to no executor."""
    process = process_of(recording, node)
    if process is None or not declares(recording, "node", node=node):
        return False
    spins = [item.data for item in recording.declared("spin") if item.process == process.name]
    # Older recordings do not tell, and neither does an EventsExecutor, which is made in C++.
    tells = bool(spins) and all("tells_added" in spin for spin in spins)
    return tells and not declares(recording, "added", node=node)


def exiting_ns(recording: Recording, process: str) -> int | None:
    """When a process began to end in its usual way, or None where it did not."""
    started = [item for item in recording.declared("started") if item.process == process]
    if not started:
        return None
    # A process may have been started again, and children may have ended under its name.
    ends_ns = (
        item.time_ns for item in recording.declared("exiting") if _same_process(item, started[-1])
    )
    return next(ends_ns, None)


def timers(recording: Recording) -> tuple[DeclaredTimer, ...]:
    """Timers that the processes declared, in the order of their declaration."""
    found = []
    for item in recording.declared("timer"):
        period_s = _number(item.data, "period_s")
        if period_s is not None and period_s > 0.0:
            callback = _text(item.data, "callback") or ""
            found.append(DeclaredTimer(period_s, item.time_ns, callback))
    return tuple(found)


def timer_of_zero(recording: Recording) -> bool:
    """Whether the processes declared a timer without a period, which :func:`timers` leaves out."""
    return any(_number(item.data, "period_s") == 0.0 for item in recording.declared("timer"))


def queues(recording: Recording, kind: Kind, topic: str) -> tuple[DeclaredQueue, ...]:
    """History and depth of the endpoints that the processes declared on a topic.

    Those that the program destroyed itself, as rclpy's wait_for_message() does, are left out
    where it kept others.
    """
    declared = _on(recording, kind, topic)
    kept = [item for item in declared if destroyed(recording, item) is None]
    found = []
    for item in kept or declared:
        depth = _number(item.data, "depth")
        history = _text(item.data, "history") or "unknown"
        found.append(DeclaredQueue(history, None if depth is None else int(depth)))
    return tuple(found)


def _on(recording: Recording, kind: Kind, topic: str) -> list[Declaration]:
    return [item for item in recording.declared(kind.value) if _text(item.data, "topic") == topic]


def dropped_ns(recording: Recording, kind: Kind, topic: str) -> int | None:
    """When a process had lost the last of its endpoints on a topic as soon as they were made.

    A constructor or a callback destroys what only its own variables hold when it returns. What was
    made before the executor spun, and is destroyed afterwards, was kept and ended on purpose; so
    was what lived for longer.
    """
    ends_ns = []
    for made in _on(recording, kind, topic):
        end = destroyed(recording, made)
        # A brief one is made and destroyed by wait_for_message().
        if end is None or made.data.get("brief") or end.data.get("brief"):
            return None
        spun_ns = [item.time_ns for item in recording.declared("spin") if _same_process(item, made)]
        if spun_ns and made.time_ns < spun_ns[0] < end.time_ns:
            return None
        if _lived_s(recording, made, end) > _MOMENT_S:
            return None
        ends_ns.append(end.time_ns)
    return max(ends_ns, default=None)


def _lived_s(recording: Recording, made: Declaration, end: Declaration) -> float:
    """How long the program had an endpoint, without what the tracer and the machine waited."""
    # The tracer held the endpoint until here, and the program began to leave there.
    begin_ns = max(_times_between(recording, "held", made, end), default=made.time_ns)
    end_ns = min(_times_between(recording, "leaving", made, end), default=end.time_ns)
    return (end_ns - begin_ns) / NS - recording.stolen_s(begin_ns, end_ns)


def _times_between(
    recording: Recording, kind: str, made: Declaration, end: Declaration
) -> list[int]:
    """When a process declared something about an endpoint that it had."""
    return [
        item.time_ns
        for item in recording.declared(kind)
        if _same_process(item, made)
        and made.time_ns < item.time_ns < end.time_ns
        and item.data.get("topic") in (None, made.data.get("topic"))
    ]


def destroyed(recording: Recording, made: Declaration) -> Declaration | None:
    """What a process declared when it destroyed an endpoint, while it was observed."""
    number = made.data.get("number")
    if number is None:
        return None
    for item in recording.declared("destroyed"):
        is_same = _same_process(item, made) and item.data.get("number") == number
        if is_same and item.time_ns < recording.stop_ns:
            return item
    return None


def _same_process(one: Declaration, other: Declaration) -> bool:
    return one.process == other.process and one.data.get("pid") == other.data.get("pid")


def profiles(recording: Recording, kind: Kind, topic: str) -> tuple[tuple[str, Qos], ...]:
    """Node and QoS of the endpoints that the processes declared on a topic.

    Only reliability and durability are declared; any other word than DDS's counts as unknown.
    """
    found = []
    for item in _on(recording, kind, topic):
        reliability, durability = _text(item.data, "reliability"), _text(item.data, "durability")
        qos = Qos(
            reliability=reliability if reliability in STRENGTH["reliability"] else "unknown",
            durability=durability if durability in STRENGTH["durability"] else "unknown",
        )
        found.append((_text(item.data, "node") or "unknown", qos))
    return tuple(found)


def left_open(recording: Recording, kind: Kind, topic: str, node: str) -> frozenset[str]:
    """Policies for which a node asked for the best that is available.

    DDS shows only what this came to with the endpoints that were there. Of several endpoints of the
    node on the topic, a policy counts if each of them left it open.
    """
    own = [item for item in _on(recording, kind, topic) if _text(item.data, "node") == node]
    return frozenset(
        policy
        for policy in ("reliability", "durability")
        if own and all(_text(item.data, policy) == "best_available" for item in own)
    )


def not_in_callback(recording: Recording, topic: str) -> bool:
    """Whether no executor had called what published the newest message, as older tracers declare.

    A last message that stops a robot may well be published by main() after Ctrl+C.
    """
    published = [
        item.data.get("in_callback")
        for item in recording.declared("published")
        if item.time_ns <= recording.stop_ns and _text(item.data, "topic") == topic
    ]
    return published[-1:] == [False] and not hides_calls(recording)


def changed_environment(recording: Recording) -> list[str]:
    """Environment variables of discovery that a program changed before rclpy.init()."""
    changed = sorted({_text(item.data, "changed") or "" for item in recording.declared("init")})
    return [name for text in changed for name in text.split()]


def process_of(recording: Recording, node: str) -> Process | None:
    """The process that declared a node, or the only one there is, or None."""
    if len(recording.processes) == 1:
        return recording.processes[0]
    for item in recording.declared("node"):
        if _text(item.data, "node") == node:
            return next((p for p in recording.processes if p.name == item.process), None)
    return None


def _number(data: Mapping[str, Any], key: str) -> float | None:
    value = data.get(key)
    # A process may declare anything: an integer that is too long for a float is no number.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 2**63:
        return None
    return float(value)


def _text(data: Mapping[str, Any], key: str) -> str | None:
    value = data.get(key)
    return value if isinstance(value, str) else None


def was_held_up(recording: Recording) -> bool:
    """Whether the machine was so busy that discovery may have lost what a node announces."""
    return recording.stolen_s(recording.launched_ns, recording.stop_ns) > _LOST_S
