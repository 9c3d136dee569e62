"""CPU time of processes, also of ended ones, and time in which the CPUs had nothing to do."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Mapping

from grader.sandbox.proc import read_proc
from grader.sandbox.usage import PROC, Process, Taken, Usage

_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_WINDOW = 3
"""How many readings it takes until the CPU time of an ended child is surely in its parent's.

Processes are read one after the other, so a child that is missing in one reading may have ended
after its parent was read. If it is missing in two, the parent was read after its end.
"""


class OrphanCpu:
    """Counts the CPU time of ended processes that no parent has got; a lower bound.

    What a process took is added to its parent's ``waited`` when the parent has waited for it, and
    to none if the parent ignores SIGCHLD (wait(2), "ERRORS"). So each reading compares what ended
    processes had with what parents got of late: the difference is lost, and is kept here.

    Attributes:
        ticks: The time that was lost so far.
        ended: How many processes have ended since the look before, if any was not waited for.
    """

    def __init__(self) -> None:
        self.ticks = 0
        self.ended = 0
        self._there: dict[Process, Taken] = {}
        self._missing: dict[Process, Taken] = {}
        self._gained: deque[int] = deque(maxlen=_WINDOW)

    def look(self, there: Mapping[Process, Taken], *, complete: bool = False) -> None:
        """Note what is there now.

        Args:
            complete: None ended while they were read: one that is missing has ended for certain.
        """
        before = {**self._missing, **self._there}
        gained = 0
        for process, taken in there.items():
            gained += taken.waited
            if process in before:
                gained -= before[process].waited
        self._gained.append(gained)
        missing = {process: taken for process, taken in before.items() if process not in there}
        ended = [
            taken for process, taken in missing.items() if complete or process in self._missing
        ]
        lost = self._without_gained(sum(taken.own + taken.waited for taken in ended))
        self.ticks += lost
        self.ended = len(ended) if lost else 0
        # One that is missing for the first time may only have ended while this was read.
        self._missing = {} if complete else {p: t for p, t in missing.items() if p in self._there}
        self._there = dict(there)

    def _without_gained(self, ticks: int) -> int:
        """What parents did not get of some time, of late; each tick that they got counts once."""
        for reading, gained in enumerate(self._gained):
            explained = min(ticks, gained)
            self._gained[reading] -= explained
            ticks -= explained
        return ticks

    def used_s(self, usages: Iterable[Usage]) -> float:
        """CPU time of processes so far, of those that have ended too."""
        there = {Process(usage.pid, usage.started): usage.taken for usage in usages}
        self.look(there)
        return (sum(map(sum, there.values())) + self.ticks) / _TICKS_PER_S


class IdleCpu:
    """Time in which the CPUs that this process may use had nothing to do."""

    def __init__(self) -> None:
        self._cpus = os.sched_getaffinity(0)
        self.cpus = len(self._cpus)
        # A container's /proc/stat (lxcfs) calls a CPU idle that another container uses.
        self._is_known = not os.path.ismount(f"{PROC}/stat")

    def ticks(self) -> int:
        """What it is so far, with waits for a disk; 0 where it is not known."""
        if not self._is_known:
            return 0
        try:
            return idle_ticks(read_proc(f"{PROC}/stat").decode("ascii"), self._cpus)
        except (OSError, ValueError, IndexError):
            return 0


def idle_ticks(stat: str, cpus: Iterable[int]) -> int:
    """Ticks in which CPUs ran no process: idle, waits for a disk, and packets (softirq).

    Where the kernel counts packets apart, they are no time of the process that floods a port.
    """
    wanted = {f"cpu{number}" for number in cpus}
    # Another line has a number for each interrupt of the machine.
    rows = (line.split() for line in stat.splitlines() if line.startswith("cpu"))
    return sum(int(row[4]) + int(row[5]) + int(row[7]) for row in rows if row[0] in wanted)
