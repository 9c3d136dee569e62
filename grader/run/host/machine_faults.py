"""What the machine may do to a run in the middle: set its clock, or run out of memory.

Messages and log lines carry the time of day. Once NTP, the host of a virtual machine or a laptop's
sleep has set that clock, the time between two of them is unknown. What the kernel ends for lack of
memory stayed within its limits: the machine had too little for all that ran on it.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Iterable, Sequence

from grader.machine.out_of_memory import oom_kills
from grader.recording.event import Breach
from grader.recording.model import NS, Process

_READINGS = 20
_TRIFLE_NS = 10_000_000
"""Far below what tolerances on periods and delays allow."""


class MachineFaults:
    """Compares clocks and counts of the kernel with those at its creation."""

    def __init__(self) -> None:
        self._ahead_ns = ahead_ns()
        self._kills = oom_kills()

    def clock_was_set(self) -> str | None:
        """A sentence if the clock was set since the beginning, else None."""
        step_ns = ahead_ns() - self._ahead_ns
        if abs(step_ns) <= _TRIFLE_NS:
            return None
        way = "forward" if step_ns > 0 else "back"
        return (
            f"the clock of this machine was set {way} by {abs(step_ns) / NS:.3g} s in the middle "
            "of the run (by NTP, the host of a virtual machine, or sleep), so the recorded "
            "times are wrong"
        )

    def out_of_memory(self, processes: Iterable[Process], breaches: Sequence[Breach]) -> str | None:
        """A sentence if the kernel may have ended one of these processes, else None."""
        now = oom_kills()
        if breaches or self._kills is None or now is None or now == self._kills:
            return None
        for process in processes:
            if process.stopped_by == "itself" and process.exit_code == -signal.SIGKILL:
                return (
                    f"this machine ran out of memory in the middle of the run: the kernel ended "
                    f"{now - self._kills} of its processes, and {process.name} was killed. Grade "
                    "fewer at once (--jobs), or on a machine with more memory"
                )
        return None


def ahead_ns() -> int:
    """How far the time of day is ahead of the monotonic clock, from the tightest of readings."""
    return max(time.time_ns() - time.monotonic_ns() for _ in range(_READINGS))
