"""Memory of processes, with pages that they share counted once."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Sequence

from grader.sandbox.proc import read_proc
from grader.sandbox.usage import PROC, Usage, usage_at

_SHARED = b"/dev/zero (deleted)"
"""What proc(5) calls shared memory without a file."""


def memory_bytes(usages: Sequence[Usage], enough: int, hidden: int = 0) -> int:
    """Memory of processes, pages that they share counted once.

    Args:
        enough: Below this a quick upper bound is returned, that counts shared pages several times.
    """
    upper = sum(usage.resident_bytes for usage in usages) + hidden
    if upper <= enough:
        return upper
    return hidden + sum(_proportional_bytes(usage) for usage in usages)


def own_bytes() -> int:
    """Memory of this very process."""
    usage = usage_at(os.getpid())
    return usage.resident_bytes if usage is not None else 0


def hidden_bytes(usages: Iterable[Usage], room: int = 0) -> int:
    """Shared memory that processes hold and that is in the resident set of none of them.

    A page of it stays when a process lets go of its place (madvise(2)), or ends. Only the kernel
    knows how much there is, so all that is mapped counts as taken.

    Args:
        room: Where all shared memory of this machine is no more than this, it is not looked for.
    """
    if _shared_bytes() <= room:
        return 0
    sizes: dict[bytes, int] = {}
    resident = 0
    for usage in usages:
        mapped = _shared_memory(usage.pid)
        if mapped:
            resident += _proportional_bytes(usage, b"Pss_Shmem:")
        for inode, size in mapped.items():
            sizes[inode] = max(size, sizes.get(inode, 0))
    return max(0, sum(sizes.values()) - resident)


def _shared_bytes() -> int:
    """No less than all shared memory that this machine holds: see proc_meminfo(5)."""
    try:
        text = read_proc(f"{PROC}/meminfo")
        sizes = dict(re.findall(rb"^(\w+):\s*(\d+) kB$", text, re.MULTILINE))
        # Whose the swapped pages are is not said there.
        swapped = int(sizes[b"SwapTotal"]) - int(sizes[b"SwapFree"])
        return 1024 * (int(sizes[b"Shmem"]) + swapped)
    except (OSError, KeyError):
        return sys.maxsize


def _shared_memory(pid: int) -> dict[bytes, int]:
    """Anonymous memory that a process has mapped to be shared: inode -> where it ends there."""
    sizes: dict[bytes, int] = {}
    try:
        with open(f"{PROC}/{pid}/maps", "rb") as file:  # noqa: PTH123  often
            text = file.read()
        if _SHARED not in text:
            # As of most processes; to split their lines would take long.
            return {}
        for line in text.splitlines():
            if line.endswith(_SHARED):
                place, _, offset, _, inode = line.split()[:5]
                begin, end = (int(number, 16) for number in place.split(b"-"))
                size = int(offset, 16) + end - begin
                sizes[inode] = max(size, sizes.get(inode, 0))
    except (OSError, ValueError):
        # It has ended.
        return {}
    return sizes


def _proportional_bytes(usage: Usage, field: bytes = b"Pss:") -> int:
    """Its pages, each divided by the number of processes that share it: proc(5)."""
    try:
        with open(f"{PROC}/{usage.pid}/smaps_rollup", "rb") as file:  # noqa: PTH123  often
            for line in file:
                if line.startswith(field):
                    return int(line.split()[1]) * 1024
    except (OSError, IndexError):
        return usage.resident_bytes
    return 0
