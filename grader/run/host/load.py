"""How busy this machine is."""

from __future__ import annotations

import contextlib
import math
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

_STAT = Path("/proc/stat")
_MEMINFO = Path("/proc/meminfo")
_GROUPS = Path("/proc/self/cgroup")
_GROUP_FOLDERS = Path("/sys/fs/cgroup")
_GROUP_FILES = {
    # cgroup v2, and v1: what a group may take, takes, and can give back of it.
    "memory.max": ("memory.current", "inactive_file"),
    "memory.limit_in_bytes": ("memory.usage_in_bytes", "total_inactive_file"),
}
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
        """Share of the memory that a program can still get: proc_meminfo(5), cgroups(7)."""
        sizes = _numbers(_MEMINFO)
        total = 1024 * sizes["MemTotal:"]
        shares = [sizes["MemAvailable:"] / sizes["MemTotal:"]]
        for folder in _groups():
            for limit, (taken, spare) in _GROUP_FILES.items():
                # It may have no limit, or no such file.
                with contextlib.suppress(OSError, ValueError, KeyError):
                    allowed = int((folder / limit).read_text())
                    if 0 < allowed < total:
                        own = int((folder / taken).read_text())
                        own -= _numbers(folder / "memory.stat")[spare]
                        shares.append(1.0 - own / allowed)
        return min(shares)


def _groups() -> Iterator[Path]:
    """Folders of the groups whose limits of memory hold for this process, also in a container."""
    with contextlib.suppress(OSError):
        for line in _GROUPS.read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if not controllers or "memory" in controllers.split(","):
                outermost = _GROUP_FOLDERS / ("memory" if controllers else "")
                folder = outermost / path.lstrip("/")
                yield from (folder, *folder.parents)[: -len(outermost.parents)]


def _numbers(file: Path) -> dict[str, int]:
    lines = map(str.split, file.read_text().splitlines())
    return {name: int(number) for name, number, *_ in lines}
