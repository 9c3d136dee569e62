"""What processes and folders take at the moment."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

_PAGE = os.sysconf("SC_PAGE_SIZE")
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_PROC = "/proc"


def descendants(of: int) -> list[int]:
    """Processes that descend from one."""
    children: dict[int, list[int]] = {}
    for name in filter(str.isdigit, os.listdir(_PROC)):  # noqa: PTH208  often
        try:
            with open(f"{_PROC}/{name}/stat", "rb") as file:  # noqa: PTH123  often
                # The command's name may contain anything, but the last ")" ends it.
                parent = int(file.read().rpartition(b")")[2].split()[1])
        except OSError:
            continue
        children.setdefault(parent, []).append(int(name))
    found: list[int] = []
    pending = [of]
    while pending:
        below = children.get(pending.pop(), [])
        found += below
        pending += below
    return found


def memory_bytes(pids: Iterable[int], enough: int) -> int:
    """Memory of processes, pages that they share counted once.

    Args:
        pids: Processes; those that have ended count nothing.
        enough: Below this a quick upper bound is returned (see proc(5): the sum of resident sets
            counts shared pages several times, the proportional ones of smaps_rollup do not).
    """
    alive = list(pids)
    upper = sum(_resident_bytes(pid) for pid in alive)
    return upper if upper <= enough else sum(_proportional_bytes(pid) for pid in alive)


def thread_count(pids: Iterable[int]) -> int:
    """Threads of processes."""
    return sum(_threads(pid) for pid in pids)


def cpu_time_s(pids: Iterable[int]) -> float:
    """CPU time of processes, and of their children that have ended and were waited for."""
    return sum(map(_ticks, pids)) / _TICKS_PER_S


def folder_usage(folders: Iterable[Path], most_bytes: int, most_files: int) -> tuple[int, int]:
    """Bytes on the disk and number of files below folders; stops to count beyond the limits."""
    total = count = 0
    pending = [str(folder) for folder in folders]
    while pending and total <= most_bytes and count <= most_files:
        try:
            with os.scandir(pending.pop()) as entries:
                for entry in entries:
                    count += 1
                    # Blocks of 512 bytes, whatever the file system's are: stat(2).
                    total += entry.stat(follow_symlinks=False).st_blocks * 512
                    if entry.is_dir(follow_symlinks=False):
                        pending.append(entry.path)
        except OSError:
            continue
    return total, count


def _resident_bytes(pid: int) -> int:
    try:
        with open(f"{_PROC}/{pid}/statm", "rb") as file:  # noqa: PTH123  often
            return int(file.read().split()[1]) * _PAGE
    except (OSError, IndexError):
        return 0


def _proportional_bytes(pid: int) -> int:
    try:
        with open(f"{_PROC}/{pid}/smaps_rollup", "rb") as file:  # noqa: PTH123  often
            for line in file:
                if line.startswith(b"Pss:"):
                    return int(line.split()[1]) * 1024
    except (OSError, IndexError):
        return _resident_bytes(pid)
    return 0


def _ticks(pid: int) -> int:
    try:
        with open(f"{_PROC}/{pid}/stat", "rb") as file:  # noqa: PTH123  often
            # utime, stime, cutime, cstime: proc(5).
            return sum(map(int, file.read().rpartition(b")")[2].split()[11:15]))
    except (OSError, ValueError):
        return 0


def _threads(pid: int) -> int:
    try:
        return len(os.listdir(f"{_PROC}/{pid}/task"))  # noqa: PTH208  often
    except OSError:
        return 0
