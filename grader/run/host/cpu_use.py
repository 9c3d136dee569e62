"""CPU time: what the student's own processes took, and how much of a wait others can explain.

A thread waits for a CPU because another one runs on it. Where that is one of the student's, the
wait is the submission's; only what others took, also rosgrade, is a disturbance.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from grader.recording.model import NS
from grader.sandbox.orphan_cpu import OrphanCpu, Process, Taken

_STAT = Path("/proc/stat")
_TICK_NS = NS // os.sysconf("SC_CLK_TCK")
# Of a CPU. With a robot in it a cell and the student's process took 0.12 of one together (the
# references of bot_controller and p_controller); what makes it take more is what it is sent.
_FLOODED = 0.7
# CPUCLOCK_SCHED: the running time of a whole process; linux/posix-timers_types.h.
_PROCESS_CLOCK = 2


@dataclass(frozen=True)
class Interval:
    """CPU time in an interval that was neither idle nor the student's, of all CPUs together."""

    begin_ns: int
    end_ns: int
    others_ns: int


def others_share(waited_ns: int, intervals: Iterable[Interval]) -> int:
    """How much of a wait for a CPU others than the student can explain, at most; nanoseconds.

    Every nanosecond that a thread waits on a CPU's queue while another one runs there is one of
    that one's CPU time; so what others had during the wait bounds their share.

    Args:
        waited_ns: Of a wait that was over within the last interval; it may have begun before it.
        intervals: Without gaps, oldest first; nothing is known without any.
    """
    known = list(intervals)
    if not known:
        return waited_ns
    began_ns = known[-1].begin_ns - waited_ns
    return min(waited_ns, sum(item.others_ns for item in known if item.end_ns > began_ns))


@dataclass(frozen=True)
class CpuTimes:
    """CPU times so far, at one moment.

    Attributes:
        student_ns: Of the student's processes, with those that they have waited for.
        idle_ns: Of the CPUs that may be used; 0 where it is not known.
        own_ns: Of this process, the cell.
        orphans: How many processes of the student's have ended since the reading before, if some
            of what they took was lost.
    """

    time_ns: int
    student_ns: int
    idle_ns: int
    own_ns: int = 0
    orphans: int = 0


def interval(before: CpuTimes, after: CpuTimes, cpus: int) -> Interval:
    """What happened between two moments."""
    all_ns = cpus * (after.time_ns - before.time_ns)
    # A process that has just ended takes its time with it until its parent is looked at.
    student_ns = max(0, after.student_ns - before.student_ns)
    own_ns = after.own_ns - before.own_ns
    if own_ns > _FLOODED * (after.time_ns - before.time_ns):
        student_ns += own_ns
    # What they took since they were seen last is unknown: it does not count as the machine's.
    student_ns += after.orphans * (after.time_ns - before.time_ns)
    idle_ns = max(0, after.idle_ns - before.idle_ns)
    return Interval(before.time_ns, after.time_ns, max(0, all_ns - student_ns - idle_ns))


class CpuMeter:
    """Reads CPU times of this machine."""

    def __init__(self) -> None:
        self._cpus = os.sched_getaffinity(0)
        self.cpus = len(self._cpus)
        # A container's /proc/stat (lxcfs) calls a CPU idle that another container uses.
        self._knows_idle = not os.path.ismount(_STAT)
        self._orphan_cpu = OrphanCpu()

    def read(self, pids: Iterable[int]) -> CpuTimes:
        """Read them now."""
        found = [_process(pid) for pid in pids]
        there = {process: taken for process, taken, _ in filter(None, found)}
        waited = os.times()
        waited_s = waited.children_user + waited.children_system
        there[Process(os.getpid(), 0)] = Taken(0, round(waited_s * NS / _TICK_NS))
        self._orphan_cpu.look(there, complete=None not in found)
        ticks = sum(taken.waited for taken in there.values()) + self._orphan_cpu.ticks
        student_ns = ticks * _TICK_NS + sum(own_ns for *_, own_ns in filter(None, found))
        times = (time.monotonic_ns(), student_ns, self._idle_ns(), time.process_time_ns())
        return CpuTimes(*times, self._orphan_cpu.ended)

    def _idle_ns(self) -> int:
        if not self._knows_idle:
            return 0
        try:
            return idle_ticks(_STAT.read_text(), self._cpus) * _TICK_NS
        except (OSError, ValueError, IndexError):
            return 0


def idle_ticks(stat: str, cpus: Iterable[int]) -> int:
    """Ticks in which CPUs had nothing to do, waits for a disk among them."""
    wanted = {f"cpu{number}" for number in cpus}
    rows = (line.split() for line in stat.splitlines())
    return sum(int(row[4]) + int(row[5]) for row in rows if row and row[0] in wanted)


def _process(pid: int) -> tuple[Process, Taken, int] | None:
    try:
        own_ns = time.clock_gettime_ns(~pid << 3 | _PROCESS_CLOCK)
        with open(f"/proc/{pid}/stat", "rb") as file:  # noqa: PTH123  often
            # The command's name may contain anything, but the last ")" ends it.
            fields = file.read().rpartition(b")")[2].split()
        # The numbers of the fields are those of proc(5), less three.
        user, system, waited_user, waited_system = map(int, fields[11:15])
        taken = Taken(user + system, waited_user + waited_system)
        return Process(pid, int(fields[19])), taken, own_ns
    except (OSError, IndexError, ValueError):
        return None
