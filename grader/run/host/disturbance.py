"""What the host takes from a run, measured while it runs.

Two instruments: a metronome, a thread that asks to be woken every 20 ms and notes how late it was;
and the time that each thread of the student was ready to run but had no CPU (its run delay).

A thread waits for a CPU because another one runs on it. Where that is one of the student's, the
wait is the submission's; only what others took, also rosgrade, is a disturbance.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from grader.recording.event import Disturbance
from grader.recording.model import NS
from grader.sandbox.usage import IdleCpu, OrphanCpu, Process, Taken, usage_at

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


_TICK_S = 0.02
_TICKS_PER_SAMPLE = 5
_STARTING = 3
_SAMPLES_PER_LOOK = 10
"""New processes are looked for in the first samples, then in one of so many, and whenever a known
one had to wait."""
_TRIFLE_NS = 2_000_000
"""A wait in one sample that needs no explanation."""
_LONGEST_STRETCH = 8.0
_KEPT = 100
"""Samples of CPU times that are kept, for waits that were long."""


def run_delays(pid: int) -> dict[int, int]:
    """Run delay of each thread of a process so far, from schedstat: thread id -> nanoseconds."""
    found: dict[int, int] = {}
    # It may end meanwhile.
    with contextlib.suppress(OSError):
        for name in os.listdir(f"/proc/{pid}/task"):  # noqa: PTH208  often
            with (
                contextlib.suppress(OSError, IndexError),
                open(f"/proc/{pid}/task/{name}/schedstat", "rb") as file,  # noqa: PTH123
            ):
                found[int(name)] = int(file.read().split()[1])
    return found


class DisturbanceMeter:
    """Samples the disturbance every 100 ms from a thread of its own."""

    def __init__(
        self,
        pids: Callable[[], Iterable[int]],
        cpu: CpuMeter | None = None,
        delays: Callable[[int], Mapping[int, int]] = run_delays,
    ) -> None:
        self._run_delays = delays
        self._pids = pids
        self._known: tuple[int, ...] = ()
        self._number = 0
        self._delays: dict[int, int] = {}
        self._samples: list[Disturbance] = []
        self._taken_ns = 0
        self._cpu = cpu or CpuMeter()
        self._times: CpuTimes | None = None
        self._intervals: deque[Interval] = deque(maxlen=_KEPT)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="metronome", daemon=True)

    def start(self) -> None:
        """Begin to measure."""
        self._times = self._cpu.read(self._pids())
        self._thread.start()

    def stop(self) -> tuple[Disturbance, ...]:
        """End the measurement and return all samples, oldest first."""
        self._stop.set()
        self._thread.join()
        return tuple(self._samples)

    @property
    def stolen_s(self) -> float:
        """Everything taken so far, in seconds: run delays and lateness."""
        return self._taken_ns / NS

    def _run(self) -> None:
        tick_ns = int(_TICK_S * NS)
        due_ns = time.monotonic_ns() + tick_ns
        worst_ns = 0
        ticks = 0
        while not self._stop.is_set():
            remaining_ns = due_ns - time.monotonic_ns()
            if remaining_ns > 0:
                time.sleep(remaining_ns / NS)
            late_ns = max(0, time.monotonic_ns() - due_ns)
            worst_ns = max(worst_ns, late_ns)
            due_ns = max(due_ns + tick_ns, time.monotonic_ns())
            ticks += 1
            if ticks % _TICKS_PER_SAMPLE == 0 or late_ns > 5 * tick_ns:
                self._sample(worst_ns)
                worst_ns = 0

    def _sample(self, late_ns: int) -> None:
        looks = self._number < _STARTING or self._number % _SAMPLES_PER_LOOK == 0
        self._number += 1
        if looks:
            self._known = tuple(self._pids())
        waited_ns = 0
        for pid in self._known:
            for thread, delay_ns in self._run_delays(pid).items():
                before_ns = self._delays.get(thread, 0)
                self._delays[thread] = delay_ns
                waited_ns = max(waited_ns, delay_ns - before_ns)
        if looks or waited_ns + late_ns > _TRIFLE_NS:
            if not looks:
                self._known = tuple(self._pids())
            self._read_cpu_times()
            waited_ns = others_share(waited_ns, self._intervals)
            late_ns = others_share(late_ns, self._intervals)
        self._taken_ns += waited_ns + late_ns
        self._samples.append(Disturbance(time.time_ns(), late_ns, waited_ns))

    def _read_cpu_times(self) -> None:
        times = self._cpu.read(self._known)
        if self._times is not None:
            self._intervals.append(interval(self._times, times, self._cpu.cpus))
        self._times = times


class Stopwatch:
    """Time since its start, less what the host took meanwhile."""

    def __init__(self, meter: DisturbanceMeter) -> None:
        self._meter = meter
        self._wall_s = time.monotonic()
        self._stolen_s = meter.stolen_s

    @property
    def elapsed_s(self) -> float:
        """Undisturbed seconds; at least an eighth of the wall time, so that every wait ends."""
        wall_s = time.monotonic() - self._wall_s
        return max(wall_s - (self._meter.stolen_s - self._stolen_s), wall_s / _LONGEST_STRETCH)
