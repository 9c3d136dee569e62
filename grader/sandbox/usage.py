"""What processes and folders take at the moment."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

_PAGE = os.sysconf("SC_PAGE_SIZE")
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_PROC = "/proc"


class Usage(NamedTuple):
    """What a process takes; all of it stands in one file, which is read often.

    Attributes:
        pid: Its id.
        parent: Of its parent.
        session: Of its session.
        cpu_s: CPU time of it, and of its children that have ended and were waited for.
        threads: How many it has.
        resident_bytes: Its resident set, pages that it shares with others among them.
    """

    pid: int
    parent: int
    session: int
    cpu_s: float
    threads: int
    resident_bytes: int


def usage_of(roots: Iterable[int]) -> list[Usage]:
    """What processes take, and all that descend from them; those that have ended take nothing."""
    below: dict[int, list[int]] = {}
    found: dict[int, Usage] = {}
    for name in filter(str.isdigit, os.listdir(_PROC)):  # noqa: PTH208  often
        usage = _usage(int(name))
        if usage is not None:
            found[usage.pid] = usage
            below.setdefault(usage.parent, []).append(usage.pid)
    wanted: list[Usage] = []
    pending = list(roots)
    while pending:
        pid = pending.pop()
        pending += below.get(pid, [])
        if pid in found:
            wanted.append(found.pop(pid))
    return wanted


def memory_bytes(usages: Sequence[Usage], enough: int) -> int:
    """Memory of processes, pages that they share counted once.

    Args:
        usages: Of the processes.
        enough: Below this a quick upper bound is returned (see proc(5): the sum of resident sets
            counts shared pages several times, the proportional ones of smaps_rollup do not).
    """
    upper = sum(usage.resident_bytes for usage in usages)
    return upper if upper <= enough else sum(map(_proportional_bytes, usages))


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


def _usage(pid: int) -> Usage | None:
    try:
        with open(f"{_PROC}/{pid}/stat", "rb") as file:  # noqa: PTH123  often
            # The command's name may contain anything, but the last ")" ends it.
            fields = file.read().rpartition(b")")[2].split()
        # The numbers of the fields are those of proc(5), less three.
        return Usage(
            pid=pid,
            parent=int(fields[1]),
            session=int(fields[3]),
            cpu_s=sum(map(int, fields[11:15])) / _TICKS_PER_S,
            threads=int(fields[17]),
            resident_bytes=int(fields[21]) * _PAGE,
        )
    except (OSError, IndexError, ValueError):
        return None


def _proportional_bytes(usage: Usage) -> int:
    try:
        with open(f"{_PROC}/{usage.pid}/smaps_rollup", "rb") as file:  # noqa: PTH123  often
            for line in file:
                if line.startswith(b"Pss:"):
                    return int(line.split()[1]) * 1024
    except (OSError, IndexError):
        return usage.resident_bytes
    return 0
