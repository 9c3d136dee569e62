"""Whether the machine ran out of memory in the middle of a run, and a student's process paid.

Whoever takes more than the sandbox allows is ended by the watchdog, or gets a MemoryError. What
the kernel ends is within its limits: the machine had too little for all that ran on it.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterable, Sequence

from grader.out_of_memory import oom_kills
from grader.recording.event import Breach
from grader.recording.model import Process


class Shortage:
    """Counts what the kernel ends for want of memory, of whomever it is."""

    def __init__(self, kills: Callable[[], int | None] = oom_kills) -> None:
        """Begin to count.

        Args:
            kills: How many there were so far, or None where nobody knows.
        """
        self._kills = kills
        self._before = kills()

    def fault(self, processes: Iterable[Process], breaches: Sequence[Breach]) -> str | None:
        """That the kernel has ended one of these, in words; None if it need not have been."""
        now = self._kills()
        if breaches or self._before is None or now is None or now == self._before:
            return None
        for process in processes:
            if process.stopped_by == "itself" and process.exit_code == -signal.SIGKILL:
                return (
                    f"this machine ran out of memory in the middle of the run: the kernel ended "
                    f"{now - self._before} of its processes, and {process.name} was killed; grade "
                    "fewer at once (--jobs), or where there is more memory"
                )
        return None
