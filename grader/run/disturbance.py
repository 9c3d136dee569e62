"""What the host takes from a run, measured while it runs.

Two instruments: a metronome, a thread that asks to be woken every 20 ms and notes how late
it was; and the kernel's run delay of each thread of the student, the time it was ready to
run but had no CPU (second number of /proc/PID/task/TID/schedstat, see "sched-stats" in the
kernel's documentation). A verdict that this could explain is not held against anybody.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable

from grader.recording.model import NS, Disturbance

_TICK_S = 0.02
_TICKS_PER_SAMPLE = 5


class DisturbanceMeter:
    """Samples the disturbance every 100 ms from a thread of its own."""

    def __init__(self, pids: Callable[[], Iterable[int]]) -> None:
        """Prepare the meter.

        Args:
            pids: The student's processes at the moment.
        """
        self._pids = pids
        self._delays: dict[int, int] = {}
        self._samples: list[Disturbance] = []
        self._taken_ns = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="metronome", daemon=True)

    def start(self) -> None:
        """Begin to measure."""
        self._thread.start()

    def stop(self) -> tuple[Disturbance, ...]:
        """End the measurement and return all samples, oldest first."""
        self._stop.set()
        self._thread.join()
        return tuple(self._samples)

    @property
    def taken_s(self) -> float:
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
        waited_ns = 0
        for pid in self._pids():
            for thread, delay_ns in run_delays(pid).items():
                before_ns = self._delays.get(thread, 0)
                self._delays[thread] = delay_ns
                waited_ns = max(waited_ns, delay_ns - before_ns)
        self._taken_ns += waited_ns + late_ns
        self._samples.append(Disturbance(time.time_ns(), late_ns, waited_ns))


def run_delays(pid: int) -> dict[int, int]:
    """Run delay of each thread of a process so far, in nanoseconds; empty where unknown."""
    found: dict[int, int] = {}
    try:
        threads = os.listdir(f"/proc/{pid}/task")  # noqa: PTH208  names only, and often
    except OSError:
        return found
    for thread in threads:
        try:
            with open(f"/proc/{pid}/task/{thread}/schedstat", "rb") as file:  # noqa: PTH123
                found[int(thread)] = int(file.read().split()[1])
        except (OSError, IndexError, ValueError):
            continue
    return found
