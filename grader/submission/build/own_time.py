"""The time that a program had for itself: wall time, less what the machine took from it.

A program computes, or it waits (for input, a lock, the network, a sleep), or it is ready and gets
no CPU. Only the last is the machine's, and only as far as others explain it: where a program's own
processes are on the CPUs, they wait for each other.
"""

from __future__ import annotations

import math
import os
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from grader.sandbox.cpu_time import IdleCpu, OrphanCpu
from grader.sandbox.usage import Usage, states

_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_THROTTLED = re.compile(r"^throttled_(usec|time) (\d+)$", re.MULTILINE)
_PER_S = {"usec": 1e6, "time": 1e9}
_STALLED = re.compile(r"^some .*total=(\d+)$", re.MULTILINE)


@dataclass(frozen=True)
class Look:
    """What is known of a program and its machine at one moment, in seconds.

    Attributes:
        unseen: How many processes have ended since the look before, if some of what they took is
            not known.
        throttled_s: In which this container got no CPU, for it had had its share (cgroups(7)).
        stalled_s: In which something on the machine waited for a disk (PSI).
        late_s: How much later this look is than it was to be.
        does: What its threads do now: ``R`` is ready or running, ``D`` waits for a disk.
    """

    time_s: float
    used_s: float = 0.0
    unseen: int = 0
    idle_s: float = 0.0
    throttled_s: float = 0.0
    stalled_s: float = 0.0
    late_s: float = 0.0
    does: str = ""


def taken_s(before: Look, after: Look, cpus: int, disk_s: float = math.inf) -> float:
    """How much of the time between two looks the machine took from a program.

    Args:
        disk_s: How much of it may be stalls of disks, at most.
    """
    wall_s = after.time_s - before.time_s
    ran_s = max(0.0, after.used_s - before.used_s)
    # This process was held up, and saw nothing of what the program did meanwhile.
    explained_s = after.late_s
    if "R" in after.does:
        idle_s = after.idle_s - before.idle_s
        others_s = cpus * wall_s - ran_s - idle_s - after.unseen * wall_s
        explained_s += max(0.0, others_s) + after.throttled_s - before.throttled_s
    if "D" in after.does:
        explained_s += min(disk_s, after.stalled_s - before.stalled_s)
    return max(0.0, min(wall_s - ran_s, explained_s))


class OwnTime:
    """A clock that stands still while the machine gives a program no CPU.

    Attributes:
        wall_s: Since its start.
        own_s: The time that it shows.
        computed_s: CPU time of all processes of the program.
    """

    def __init__(self, disk_s: float) -> None:
        """Start it.

        Args:
            disk_s: How long it stands still for disks, at most: nothing says who keeps them busy.
        """
        self._disk_s = disk_s
        self.wall_s = self.own_s = self.computed_s = 0.0
        self._cpu = OrphanCpu()
        self._idle = IdleCpu()
        self._last = self._look((), 0.0)

    def look(self, usages: Sequence[Usage], late_s: float) -> None:
        """Read it, with what the processes of the program take now."""
        now = self._look(usages, late_s)
        wall_s = now.time_s - self._last.time_s
        self.wall_s += wall_s
        self.own_s += wall_s - taken_s(self._last, now, self._idle.cpus, self._disk_s)
        if "D" in now.does:
            self._disk_s = max(0.0, self._disk_s - (now.stalled_s - self._last.stalled_s))
        self.computed_s, self._last = now.used_s, now

    def _look(self, usages: Sequence[Usage], late_s: float) -> Look:
        return Look(
            time_s=time.monotonic(),
            used_s=self._cpu.used_s(usages),
            unseen=self._cpu.ended,
            idle_s=self._idle.ticks() / _TICKS_PER_S,
            throttled_s=throttled_s(),
            stalled_s=stalled_s(),
            late_s=late_s,
            does="".join(states(usages)),
        )


def throttled_s(root: Path = Path("/sys/fs/cgroup")) -> float:
    """Time in which the container of this process was kept from all CPUs, as far as it can see."""
    found = _THROTTLED.search(_text(root / "cpu.stat") or _text(root / "cpu/cpu.stat"))
    return int(found[2]) / _PER_S[found[1]] if found else 0.0


def stalled_s(file: Path = Path("/proc/pressure/io")) -> float:
    """Time in which something on this machine waited for a disk; 0 where it is not known."""
    found = _STALLED.search(_text(file))
    return int(found[1]) / 1e6 if found else 0.0


def _text(file: Path) -> str:
    try:
        return file.read_text()
    except OSError:
        return ""
