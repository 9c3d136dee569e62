"""What processes take, as the kernel tells it in ``/proc``, and the size of folders."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from grader.sandbox.proc import read_proc

_PAGE = os.sysconf("SC_PAGE_SIZE")
PROC = "/proc"


class Process(NamedTuple):
    """What tells a process from a later one with its number."""

    pid: int
    started: int


class Taken(NamedTuple):
    """CPU time of a process in ticks, and that of the children that it has waited for: proc(5)."""

    own: int
    waited: int


class Usage(NamedTuple):
    """What a process takes, from a file that is read often: ``/proc/PID/stat``."""

    pid: int
    parent: int
    session: int
    started: int
    taken: Taken
    threads: int
    resident_bytes: int
    state: str = "S"


def usage_of(roots: Iterable[int]) -> list[Usage]:
    """What processes take, and all that descend from them; those that have ended take nothing."""
    children: dict[int, list[int]] = {}
    usages: dict[int, Usage] = {}
    for name in filter(str.isdigit, os.listdir(PROC)):  # noqa: PTH208  often
        usage = usage_at(int(name))
        if usage is not None:
            usages[usage.pid] = usage
            children.setdefault(usage.parent, []).append(usage.pid)
    descendants: list[Usage] = []
    pending = list(roots)
    while pending:
        pid = pending.pop()
        pending += children.get(pid, [])
        if pid in usages:
            descendants.append(usages.pop(pid))
    return descendants


def states(usages: Iterable[Usage]) -> set[str]:
    """What the threads of processes do, such as ``R``: proc(5), "state"."""
    return {state for one in usages for state in (one.state, *_states_of_threads(one))}


def _states_of_threads(usage: Usage) -> Iterator[str]:
    if usage.threads == 1:
        return
    # They may end meanwhile.
    with contextlib.suppress(OSError):
        for name in os.listdir(f"{PROC}/{usage.pid}/task"):  # noqa: PTH208  often
            thread = usage_at(int(name), f"{PROC}/{usage.pid}/task")
            if thread is not None:
                yield thread.state


def open_files(usages: Iterable[Usage]) -> int:
    """How many descriptors processes have open together.

    What is behind one may hold memory of the kernel's that is counted nowhere.
    """
    return sum(_open_files(usage.pid) for usage in usages)


def files_in_flight(usages: Iterable[Usage]) -> int:
    """How many descriptors wait in sockets of processes: SCM_RIGHTS, see unix(7)."""
    return sum(_in_flight(usage.pid) for usage in usages)


def folder_usage(folders: Iterable[Path], most_bytes: int, most_files: int) -> tuple[int, int]:
    """Bytes on the disk and number of files below folders; stops to count beyond the limits."""
    total = count = 0
    pending = [str(folder) for folder in folders]
    while pending and total <= most_bytes and count <= most_files:
        try:
            with os.scandir(pending.pop()) as entries:
                for entry in entries:
                    count += 1
                    # Blocks of 512 bytes on every file system: stat(2).
                    total += entry.stat(follow_symlinks=False).st_blocks * 512
                    if entry.is_dir(follow_symlinks=False):
                        pending.append(entry.path)
        except OSError:
            continue
    return total, count


def usage_at(pid: int, folder: str = PROC) -> Usage | None:
    """What one process takes by itself; None where it has ended."""
    try:
        # The command's name may contain anything, but the last ")" ends it.
        fields = read_proc(f"{folder}/{pid}/stat").rpartition(b")")[2].split()
        # The numbers of the fields are those of proc(5), less three.
        return Usage(
            pid=pid,
            parent=int(fields[1]),
            session=int(fields[3]),
            started=int(fields[19]),
            taken=Taken(int(fields[11]) + int(fields[12]), int(fields[13]) + int(fields[14])),
            threads=int(fields[17]),
            resident_bytes=int(fields[21]) * _PAGE,
            state=fields[0].decode(),
        )
    except (OSError, IndexError, ValueError):
        return None


def _open_files(pid: int) -> int:
    folder = f"{PROC}/{pid}/fd"
    try:
        # Since Linux 6.2 this is their number (proc(5)); before, it was 0.
        return os.stat(folder).st_size or len(os.listdir(folder))  # noqa: PTH116, PTH208  often
    except PermissionError:
        # For how many it has room, which no process can hide.
        with contextlib.suppress(OSError):
            text = read_proc(f"{PROC}/{pid}/status")
            found = re.search(rb"^FDSize:\s*(\d+)$", text, re.MULTILINE)
            return int(found[1]) if found else 0
    except OSError:
        pass
    return 0


def _in_flight(pid: int) -> int:
    folder = f"{PROC}/{pid}/fd"
    count = 0
    # It may have ended, keep to itself what it has open, or close any of it meanwhile.
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):  # noqa: PTH208  often
            with contextlib.suppress(FileNotFoundError):
                if os.readlink(f"{folder}/{name}").startswith("socket:"):  # noqa: PTH115  often
                    text = read_proc(f"{folder}info/{name}")
                    waiting = re.search(rb"^scm_fds:\s*(\d+)$", text, re.MULTILINE)
                    count += int(waiting[1]) if waiting else 0
    return count
