"""How busy this machine is."""

from __future__ import annotations

import math
import os
import re
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
        self._average = 0.0
        self._sampled_s = time.monotonic()

    def runnable(self) -> float:
        """Average, with a time constant of 0.4 s, of ``procs_running`` of /proc/stat."""
        now_s = time.monotonic()
        passed_s = now_s - self._sampled_s
        if passed_s >= _SAMPLE_S:
            (line,) = re.findall(r"^procs_running (\d+)$", _STAT.read_text(), re.MULTILINE)
            weight = 1 - math.exp(-passed_s / _MEMORY_S)
            self._average += weight * (int(line) - 1 - self._average)
            self._sampled_s = now_s
        return self._average

    def free_memory(self) -> float:
        """Share of the memory that a program can still get without swapping: proc_meminfo(5)."""
        sizes = dict(re.findall(r"^(\w+): +(\d+) kB$", _MEMINFO.read_text(), re.MULTILINE))
        return int(sizes["MemAvailable"]) / int(sizes["MemTotal"])
