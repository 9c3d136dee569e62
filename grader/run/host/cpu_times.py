"""Who had the CPUs: the student's processes, this cell, or others on the machine."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import takewhile

from grader.recording.model import NS
from grader.sandbox.cpu_time import IdleCpu, OrphanCpu
from grader.sandbox.usage import Process, Taken, usage_at

_TICK_NS = NS // os.sysconf("SC_CLK_TCK")
# Of a CPU. With a robot in it a cell and the student's process took 0.12 of one together (the
# references of bot_controller and p_controller); what makes it take more is what it is sent.
_OWN_SHARE = 0.25
# CPUCLOCK_SCHED: the running time of a whole process; linux/posix-timers_types.h.
_PROCESS_CLOCK = 2


@dataclass(frozen=True)
class Interval:
    """CPU time in an interval that others can have taken from the student, at most."""

    begin_ns: int
    end_ns: int
    others_ns: int


def others_share(waited_ns: int, intervals: Sequence[Interval]) -> int:
    """How much of a wait for a CPU others than the student can explain, at most; nanoseconds.

    Every nanosecond that a thread waits on a CPU's queue while another one runs there is one of
    that one's CPU time; so what others had during the wait bounds their share.

    Args:
        waited_ns: Of a wait that was over within the last interval; it may have begun before it.
        intervals: Without gaps, oldest first; nothing is known without any.
    """
    if not intervals:
        return waited_ns
    began_ns = intervals[-1].begin_ns - waited_ns
    within = takewhile(lambda item: item.end_ns > began_ns, reversed(intervals))
    return min(waited_ns, sum(item.others_ns for item in within))


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
    # A process that has just ended takes its time with it until its parent is looked at.
    student_ns = max(0, after.student_ns - before.student_ns)
    length_ns = after.time_ns - before.time_ns
    student_ns += max(0, after.own_ns - before.own_ns - round(_OWN_SHARE * length_ns))
    # What they took since they were seen last is unknown: it does not count as the machine's.
    student_ns += after.orphans * length_ns
    idle_ns = max(0, after.idle_ns - before.idle_ns)
    others_ns = min(cpus * length_ns - idle_ns, length_ns) - student_ns
    return Interval(before.time_ns, after.time_ns, max(0, others_ns))


class CpuMeter:
    """Reads CPU times of this machine."""

    def __init__(self) -> None:
        self._idle = IdleCpu()
        self.cpus = self._idle.cpus
        self._orphan_cpu = OrphanCpu()

    def read(self, pids: Iterable[int]) -> CpuTimes:
        """Read them now."""
        own = {pid: _own_ns(pid) for pid in pids}
        found = [usage_at(pid) for pid, own_ns in own.items() if own_ns is not None]
        there = {Process(one.pid, one.started): one.taken for one in found if one is not None}
        complete = len(there) == len(own)
        waited = os.times()
        waited_s = waited.children_user + waited.children_system
        there[Process(os.getpid(), 0)] = Taken(0, round(waited_s * NS / _TICK_NS))
        self._orphan_cpu.look(there, complete=complete)
        ticks = sum(taken.waited for taken in there.values()) + self._orphan_cpu.ticks
        student_ns = ticks * _TICK_NS + sum(filter(None, own.values()))
        idle_ns = self._idle.ticks() * _TICK_NS
        times = (time.monotonic_ns(), student_ns, idle_ns, time.process_time_ns())
        return CpuTimes(*times, self._orphan_cpu.ended)


def _own_ns(pid: int) -> int | None:
    try:
        return time.clock_gettime_ns(~pid << 3 | _PROCESS_CLOCK)
    except OSError:
        return None
