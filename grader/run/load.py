"""How busy this machine is, whoever keeps it busy."""

from __future__ import annotations

import math
import os
import time
from pathlib import Path

_STAT = Path("/proc/stat")
_MEMINFO = Path("/proc/meminfo")
_SAMPLE_S = 0.04
_MEMORY_S = 0.4


def cpu_count() -> int:
    """CPUs that this process may use."""
    return len(os.sched_getaffinity(0))


class Load:
    """Threads that run or wait for a CPU, on average over the last moment."""

    def __init__(self) -> None:
        """Nothing is known yet: an idle machine is assumed."""
        self._average = 0.0
        self._sampled_s = time.monotonic()

    def runnable(self) -> float:
        """Sample if it is time, and return the average.

        The samples are ``procs_running`` of /proc/stat (proc(5)): runnable threads of the whole
        machine, less the one that asks. Older samples fade with a time constant of 0.4 s.
        """
        now_s = time.monotonic()
        passed_s = now_s - self._sampled_s
        if passed_s >= _SAMPLE_S:
            weight = 1 - math.exp(-passed_s / _MEMORY_S)
            self._average += weight * (_procs_running() - 1 - self._average)
            self._sampled_s = now_s
        return self._average

    def free_memory(self) -> float:
        """Share of the machine's memory that a program can still get without swapping.

        ``MemAvailable`` of ``MemTotal`` in /proc/meminfo, see proc_meminfo(5).
        """
        sizes = {
            name: int(size.split()[0])
            for name, _, size in (line.partition(":") for line in _MEMINFO.read_text().splitlines())
        }
        return sizes["MemAvailable"] / sizes["MemTotal"]


def _procs_running() -> int:
    for line in _STAT.read_bytes().splitlines():
        if line.startswith(b"procs_running"):
            return int(line.split()[1])
    return 1
