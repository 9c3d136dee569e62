"""How busy this machine is, whoever keeps it busy."""

from __future__ import annotations

import contextlib
import math
import os
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
        """Share of the memory that a program can still get without swapping.

        ``MemAvailable`` of ``MemTotal`` in /proc/meminfo, see proc_meminfo(5), or what is left of
        the limit of a container, which that does not show; see cgroups(7).
        """
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
    """Folders of the groups whose limits of memory hold for this process.

    A container may see its own group as the outermost one and still name it as the machine does.
    """
    with contextlib.suppress(OSError):
        for line in _GROUPS.read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if not controllers or "memory" in controllers.split(","):
                outermost = _GROUP_FOLDERS / ("memory" if controllers else "")
                folder = outermost / path.lstrip("/")
                yield from (folder, *folder.parents)[: -len(outermost.parents)]


def _numbers(file: Path) -> dict[str, int]:
    """A file of names and numbers, one of each in a line."""
    lines = map(str.split, file.read_text().splitlines())
    return {name: int(number) for name, number, *_ in lines}


def _procs_running() -> int:
    for line in _STAT.read_bytes().splitlines():
        if line.startswith(b"procs_running"):
            return int(line.split()[1])
    return 1
