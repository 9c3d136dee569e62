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

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping

from grader.recording.event import Disturbance
from grader.recording.model import NS
from grader.run.host.cpu_times import CpuMeter, CpuTimes, Interval, interval, others_share
from grader.run.host.run_delay import Scheduled, Waits, beyond, is_blocked, scheduled, uncounted

_TICK_S = 0.02
_TICKS_PER_SAMPLE = 5
_STARTING = 3
_SAMPLES_PER_LOOK = 10
"""New processes are looked for in the first samples, then in one of so many, and whenever a known
one had to wait."""
_TRIFLE_NS = 2_000_000
"""A wait in one sample that needs no explanation."""
_KEPT = 100
"""Samples of CPU times that are kept, for waits that were long."""


class DisturbanceMeter:
    """Samples the disturbance every 100 ms from a thread of its own."""

    def __init__(
        self,
        pids: Callable[[], Iterable[int]],
        cpu: CpuMeter | None = None,
        threads_of: Callable[[int], Mapping[int, Scheduled]] = scheduled,
        is_blocked: Callable[[int], bool] = is_blocked,
    ) -> None:
        self._threads_of = threads_of
        self._is_blocked = is_blocked
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
        before_ns = self._sampled_ns
        waited_ns, late_ns = self._of_others(now_ns, late_ns)
        if self._stays_blocked():
            waited_ns = max(waited_ns, now_ns - before_ns)
        waited_ns = uncounted(waited_ns, now_ns, self._counted)
        self._counted.append((before_ns, now_ns, waited_ns))
        late_ns = beyond(late_ns, waited_ns, now_ns - before_ns)
        self._taken_ns += waited_ns + late_ns
        # Last, so that what was taken until then is known to who reads it.
        self._sampled_ns = now_ns
        self._samples.append(Disturbance(time_ns, late_ns, waited_ns))

    def _of_others(self, now_ns: int, late_ns: int) -> tuple[int, int]:
        """What others than the student can explain: of its longest wait, and of a lateness."""
        looks = self._number < _STARTING or self._number % _SAMPLES_PER_LOOK == 0
        self._number += 1
        if looks:
            self._known = tuple(self._pids())
        threads: dict[int, Scheduled] = {}
        for pid in self._known:
            threads |= self._threads_of(pid)
        waited_ns = self._waits.longest_ns(now_ns, threads)
        if not looks and waited_ns + late_ns <= _TRIFLE_NS:
            return waited_ns, late_ns
        if not looks:
            self._known = tuple(self._pids())
        self._read_cpu_times()
        return others_share(waited_ns, self._intervals), others_share(late_ns, self._intervals)

    def _stays_blocked(self) -> bool:
        """Whether some process of the student's waits for the kernel, now as at the last sample."""
        before, self._was_blocked = self._was_blocked, any(map(self._is_blocked, self._known))
        return before and self._was_blocked

    def _read_cpu_times(self) -> None:
        times = self._cpu.read(self._known)
        if self._times is not None:
            self._intervals.append(interval(self._times, times, self._cpu.cpus))
        self._times = times
