"""What the processes of a run printed, short enough for a report."""

from __future__ import annotations

from dataclasses import dataclass, replace

from grader.recording.model import LogLine, Recording

KEPT_LINES = 150
"""Lines of output shown from the beginning, and again from the end."""
KEPT_CHARACTERS = 2000
"""Characters shown of a line."""


@dataclass(frozen=True)
class Output:
    """What the processes printed; ``left_out`` lines are missing between head and tail."""

    head: tuple[LogLine, ...]
    tail: tuple[LogLine, ...]
    left_out: int
    dropped_bytes: int


def printed(recording: Recording) -> tuple[LogLine, ...]:
    """Lines that the processes wrote; /rosout only where there are none.

    rclpy writes each log message to stderr and to /rosout: shown together, all would be twice.
    """
    written = tuple(entry for entry in recording.log if entry.stream != "rosout")
    return written or recording.log


def shorten(recording: Recording) -> Output:
    """The output of a run, without its middle where it is long."""
    lines = tuple(replace(entry, text=_cut(entry.text)) for entry in printed(recording))
    dropped = sum(process.dropped_bytes for process in recording.processes)
    tail = lines[KEPT_LINES:][-KEPT_LINES:]
    return Output(lines[:KEPT_LINES], tail, max(0, len(lines) - 2 * KEPT_LINES), dropped)


def _cut(text: str) -> str:
    more = len(text) - KEPT_CHARACTERS
    return f"{text[:KEPT_CHARACTERS]}… ({more:,} more characters)" if more > 0 else text
