"""What the host takes from a run, measured while it runs.

Three instruments: a metronome, a thread that asks to be woken every 20 ms and notes how late it
was; the time that each thread of the student was ready to run but had no CPU (its run delay); and
while it starts, whether a process of the student waits for the kernel, as for a page of a library
that a busy disk has not read yet.

A thread waits for a CPU because another one runs on it. Where that is one of the student's, the
wait is the submission's; only what others took, also rosgrade, is a disturbance. And a submission
that had a whole CPU lacked none: what it starts besides it cannot make a delay of the machine.
So this is measured here once. Nobody takes any of it off, or gives it back, a second time.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import NamedTuple

from grader.recording.event import LONGEST_STRETCH, Disturbance
from grader.recording.model import NS
from grader.sandbox.proc import read_proc
from grader.sandbox.usage import IdleCpu, OrphanCpu, Process, Taken, usage_at

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


_TICK_S = 0.02
_TICKS_PER_SAMPLE = 5
_STARTING = 3
_SAMPLES_PER_LOOK = 10
"""New processes are looked for in the first samples, then in one of so many, and whenever a known
one had to wait."""
_COMPUTES = 0.9
"""Share of its life that a thread runs or waits for a CPU, if all it does is to compute."""
_START_NS = NS
"""CPU time that a program may need to start: a node takes 0.4 s to import rclpy and be made."""
_TRIFLE_NS = 2_000_000
"""A wait in one sample that needs no explanation."""
_KEPT = 100
"""Samples of CPU times that are kept, for waits that were long."""


class Scheduled(NamedTuple):
    """How long a thread ran so far, and how long it waited for a CPU while it was ready to run."""

    ran_ns: int
    waited_ns: int


def scheduled(pid: int) -> dict[int, Scheduled]:
    """Each thread of a process by its id, from schedstat (the kernel's sched-stats.rst)."""
    found: dict[int, Scheduled] = {}
    # It may end meanwhile.
    with contextlib.suppress(OSError):
        for name in os.listdir(f"/proc/{pid}/task"):  # noqa: PTH208  often
            with contextlib.suppress(OSError, IndexError, ValueError):
                text = read_proc(f"/proc/{pid}/task/{name}/schedstat")
                ran_ns, waited_ns, _ = map(int, text.split())
                found[int(name)] = Scheduled(ran_ns, waited_ns)
    return found


class Waits:
    """How long threads of the submission wait for a CPU.

    Those that do nothing but compute, more of them than there are CPUs, would wait on any machine.
    Once they have had more than their starts need, they explain no delay.
    """

    def __init__(self, cpus: int) -> None:
        self._cpus = cpus
        self._born_ns: dict[int, int] = {}
        self._waited_ns: dict[int, int] = {}

    def longest_ns(self, now_ns: int, threads: Mapping[int, Scheduled]) -> int:
        """The longest wait since the look before."""
        for thread, one in threads.items():
            self._born_ns.setdefault(thread, now_ns - sum(one))
        computing = {
            thread
            for thread, one in threads.items()
            if sum(one) >= _COMPUTES * (now_ns - self._born_ns[thread])
        }
        had_ns = sum(threads[thread].ran_ns for thread in computing)
        left_out = len(computing) > self._cpus and had_ns > _START_NS * len(computing)
        longest_ns = 0
        for thread, one in threads.items():
            before_ns = self._waited_ns.get(thread, 0)
            self._waited_ns[thread] = one.waited_ns
            if not (left_out and thread in computing):
                longest_ns = max(longest_ns, one.waited_ns - before_ns)
        return longest_ns


def uncounted(waited_ns: int, end_ns: int, samples: Sequence[tuple[int, int, int]]) -> int:
    """How much of a wait that ended now no other thread's wait has counted for.

    Threads wait at the same time, but the time is lost once.

    Args:
        samples: Begin, end and counted wait of the samples before, without gaps, oldest first.
    """
    begin_ns = end_ns - waited_ns
    within = takewhile(lambda sample: sample[1] > begin_ns, reversed(samples))
    known = (min(counted, to - max(at, begin_ns)) for at, to, counted in within)
    return max(0, waited_ns - sum(known))


def beyond(late_ns: int, waited_ns: int, length_ns: int) -> int:
    """How late the probe was beyond what the student waited, in a sample of some length.

    A machine that stands still holds up both at once, and that is one delay.
    """
    return min(late_ns, max(length_ns, waited_ns, late_ns) - waited_ns)


def is_blocked(pid: int) -> bool:
    """Whether a process waits for the kernel, uninterruptibly: state D in proc_pid_stat(5)."""
    try:
        status = read_proc(f"/proc/{pid}/stat")
    except OSError:
        return False
    return status[status.rindex(b")") + 2 :].startswith(b"D")


class DisturbanceMeter:
    """Samples the disturbance every 100 ms from a thread of its own."""

    def __init__(
        self,
        pids: Callable[[], Iterable[int]],
        cpu: CpuMeter | None = None,
        threads: Callable[[int], Mapping[int, Scheduled]] = scheduled,
        blocked: Callable[[int], bool] = is_blocked,
    ) -> None:
        self._threads = threads
        self._blocked = blocked
        self._was_blocked = False
        self._pids = pids
        self._known: tuple[int, ...] = ()
        self._number = 0
        self._samples: list[Disturbance] = []
        self._taken_ns = 0
        self._sampled_ns = 0
        self._counted: deque[tuple[int, int, int]] = deque(maxlen=_KEPT)
        self._cpu = cpu or CpuMeter()
        self._waits = Waits(self._cpu.cpus)
        self._times: CpuTimes | None = None
        self._intervals: deque[Interval] = deque(maxlen=_KEPT)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="metronome", daemon=True)

    def start(self) -> None:
        """Begin to measure."""
        self._times = self._cpu.read(self._pids())
        self._sampled_ns = time.monotonic_ns()
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

    @property
    def sampled_s(self) -> float:
        """When the last sample was taken, as :func:`time.monotonic` has it."""
        return self._sampled_ns / NS

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
        # What is read may be older than the end of this method: it can be held up as well.
        now_ns, time_ns = time.monotonic_ns(), time.time_ns()
        looks = self._number < _STARTING or self._number % _SAMPLES_PER_LOOK == 0
        self._number += 1
        if looks:
            self._known = tuple(self._pids())
        threads: dict[int, Scheduled] = {}
        for pid in self._known:
            threads |= self._threads(pid)
        waited_ns = self._waits.longest_ns(now_ns, threads)
        if looks or waited_ns + late_ns > _TRIFLE_NS:
            if not looks:
                self._known = tuple(self._pids())
            self._read_cpu_times()
            waited_ns = others_share(waited_ns, self._intervals)
            late_ns = others_share(late_ns, self._intervals)
        blocked, before_ns = any(map(self._blocked, self._known)), self._sampled_ns
        if blocked and self._was_blocked:
            waited_ns = max(waited_ns, now_ns - before_ns)
        self._was_blocked = blocked
        waited_ns = uncounted(waited_ns, now_ns, self._counted)
        self._counted.append((before_ns, now_ns, waited_ns))
        late_ns = beyond(late_ns, waited_ns, now_ns - before_ns)
        self._taken_ns += waited_ns + late_ns
        # Last, so that what was taken until then is known to who reads it.
        self._sampled_ns = now_ns
        self._samples.append(Disturbance(time_ns, late_ns, waited_ns))

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
        return self._undisturbed_s(time.monotonic())

    @property
    def measured_s(self) -> float:
        """The same until the last sample: what the machine took since then is not known yet."""
        return self._undisturbed_s(self._meter.sampled_s)

    def _undisturbed_s(self, now_s: float) -> float:
        wall_s = now_s - self._wall_s
        least_s = (time.monotonic() - self._wall_s) / LONGEST_STRETCH
        return max(wall_s - (self._meter.stolen_s - self._stolen_s), least_s)
