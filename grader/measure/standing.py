"""Calls of the student's functions that lasted, as their process declared: where it stood."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from grader.recording.model import NS, Recording

# A process tells once in a second; a machine that is busy may hold it up.
_LATE_NS = 2 * NS
_LASTING_NS = NS


@dataclass(frozen=True)
class Standing:
    """A call that had not returned when the tracer looked; a process may declare anything.

    Attributes:
        function: Whose call; of a callback that which rclpy called.
        in_callback: rclpy had called it.
        line: Where the call was, perhaps in another function that it called.
        loop: The line of the loop that it was in, or 0.
    """

    process: str
    function: str
    in_callback: bool
    file: str
    line: int
    text: str
    loop_file: str
    loop: int
    loop_text: str
    began_ns: int
    seen_ns: int


def standing(recording: Recording, process: str | None = None) -> list[Standing]:
    """What the processes, or one of them, declared while they were observed."""
    declared = [
        _read(item.process, item.data)
        for item in recording.declared("stands")
        if process in (None, item.process) and item.time_ns <= recording.stop_ns
    ]
    return [stand for stand in declared if stand is not None]


def at_the_end(recording: Recording, process: str) -> Standing | None:
    """The call that a process was in when the observation ended; a callback before all others."""
    late_ns = _LATE_NS + int(recording.stolen_s(recording.launched_ns, recording.stop_ns) * NS)
    stands = standing(recording, process)
    found = [
        one
        for one in stands
        if recording.stop_ns - one.seen_ns < late_ns
        and one.seen_ns - one.began_ns > _LASTING_NS
        # A function that was called before returned then, if only late.
        and all(
            one.began_ns == other.began_ns or one.function != other.function for other in stands
        )
    ]
    return max(found, key=lambda one: (one.in_callback, one.seen_ns), default=None)


def longest_callback(recording: Recording, process: str | None = None) -> Standing | None:
    """The call of a callback that lasted the longest; None where all were short."""
    found = [one for one in standing(recording, process) if one.in_callback]
    return max(found, key=lambda one: one.seen_ns - one.began_ns, default=None)


def _read(process: str, data: Mapping[str, Any]) -> Standing | None:
    keys = ("function", "file", "text", "loop_file", "loop_text")
    texts: dict[str, Any] = {key: str(data.get(key)) for key in keys}
    numbers: dict[str, Any] = {
        key: data.get(key) for key in ("line", "loop", "began_ns", "seen_ns")
    }
    if not all(type(number) is int and 0 <= number < 2**63 for number in numbers.values()):
        return None
    return Standing(process, in_callback=data.get("in_callback") is True, **texts, **numbers)
