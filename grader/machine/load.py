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
_GROUP_FILES = (
    ("memory.max", "memory.current", "inactive_file"),
    ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
)
"""Of cgroup v2 and v1: limit, use, and the line of memory.stat that says what is only cached."""
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
        """Share of the memory that a program can still get without swapping: proc_meminfo(5).

        Or what is left of the limit of a container, as Gradescope sets one: cgroups(7).
        """
        sizes = dict(re.findall(r"^(\w+): +(\d+) kB$", _MEMINFO.read_text(), re.MULTILINE))
        shares = [int(sizes["MemAvailable"]) / int(sizes["MemTotal"])]
        for group in _groups():
            for limit_file, use_file, cache_line in _GROUP_FILES:
                # Most groups have no limit, and a group of v1 has no file of v2.
                with contextlib.suppress(OSError, ValueError, IndexError):
                    limit = int((group / limit_file).read_text())
                    statistics = (group / "memory.stat").read_text()
                    cached = re.findall(rf"^{cache_line} (\d+)$", statistics, re.MULTILINE)
                    used = int((group / use_file).read_text()) - int(cached[0])
                    if limit < 1024 * int(sizes["MemTotal"]):
                        shares.append(1.0 - used / limit)
        return min(shares)


def _groups() -> Iterator[Path]:
    """Folders of the groups of this process, outwards; a container may see its own as the root."""
    for controllers, path in re.findall(r"^\d+:(.*?):(.*)$", _GROUPS.read_text(), re.MULTILINE):
        if not controllers or "memory" in controllers.split(","):
            root = _GROUP_FOLDERS / ("memory" if controllers else "")
            folder = root / path.lstrip("/")
            yield from (folder, *folder.parents)[: -len(root.parents)]
