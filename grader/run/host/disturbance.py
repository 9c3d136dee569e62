"""What the host takes from a run, measured while it runs.

Two instruments: a metronome, a thread that asks to be woken every 20 ms and notes how late it was;
and the time that each thread of the student was ready to run but had no CPU (its run delay). Of
both only what others than the student's processes can explain is counted.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping

from grader.recording.event import Disturbance
from grader.recording.model import NS
from grader.run.host.cpu_use import CpuMeter, CpuTimes, Interval, interval, others_share

_TICK_S = 0.02
_TICKS_PER_SAMPLE = 5
_STARTING = 3
_SAMPLES_PER_LOOK = 10
"""Processes are looked for in the first samples, in one of so many of the others, and where one
of those that are known had to wait."""
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
    """Time since its start, less what the host took from us meanwhile."""

    def __init__(self, meter: DisturbanceMeter) -> None:
        self._meter = meter
        self._wall_s = time.monotonic()
        self._stolen_s = meter.stolen_s

    @property
    def elapsed_s(self) -> float:
        """Undisturbed seconds; at least an eighth of the wall time, so that every wait ends."""
        wall_s = time.monotonic() - self._wall_s
        return max(wall_s - (self._meter.stolen_s - self._stolen_s), wall_s / _LONGEST_STRETCH)
