"""Memory, files and CPU time of processes, also of ended ones, and the size of folders.

What a process took is added to its parent's when the parent has waited for it, and to none if the
parent ignores SIGCHLD (wait(2), "ERRORS"). So what each of them had when it was seen last is kept.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from grader.sandbox.proc import read_proc

_PAGE = os.sysconf("SC_PAGE_SIZE")
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_PROC = "/proc"
_SHARED = b"/dev/zero (deleted)"
_WINDOW = 3
"""How many readings it takes until the CPU time of an ended child is surely in its parent's.

Processes are read one after the other, so a child that is missing in one reading may have ended
after its parent was read. If it is missing in two, the parent was read after its end.
"""


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


class OrphanCpu:
    """Keeps an account of processes that are looked at again and again; a lower bound.

    Attributes:
        ended: How many processes have ended since the look before, if any was not waited for.
    """

    def __init__(self) -> None:
        self.ticks = 0
        self.ended = 0
        self._there: dict[Process, Taken] = {}
        self._missing: dict[Process, Taken] = {}
        self._gained: deque[int] = deque(maxlen=_WINDOW)

    def look(self, there: Mapping[Process, Taken], *, complete: bool = False) -> None:
        """Note what is there now.

        Args:
            complete: None ended while they were read: one that is missing has ended for certain.
        """
        before = {**self._missing, **self._there}
        self._gained.append(
            sum(
                taken.waited - (before[one].waited if one in before else 0)
                for one, taken in there.items()
            )
        )
        missing = {one: taken for one, taken in before.items() if one not in there}
        ended = [taken for one, taken in missing.items() if complete or one in self._missing]
        lost = sum(taken.own + taken.waited for taken in ended)
        for age, gained in enumerate(self._gained):
            found = min(lost, gained)
            self._gained[age] -= found
            lost -= found
        self.ticks += lost
        self.ended = len(ended) if lost else 0
        self._missing = {
            one: taken for one, taken in missing.items() if one in self._there and not complete
        }
        self._there = dict(there)

    def used_s(self, usages: Iterable[Usage]) -> float:
        """CPU time of processes so far, of those that have ended too."""
        there = {Process(one.pid, one.started): one.taken for one in usages}
        self.look(there)
        return (sum(map(sum, there.values())) + self.ticks) / _TICKS_PER_S


def usage_of(roots: Iterable[int]) -> list[Usage]:
    """What processes take, and all that descend from them; those that have ended take nothing."""
    below: dict[int, list[int]] = {}
    found: dict[int, Usage] = {}
    for name in filter(str.isdigit, os.listdir(_PROC)):  # noqa: PTH208  often
        usage = usage_at(int(name))
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


def states(usages: Iterable[Usage]) -> set[str]:
    """What the threads of processes do, such as ``R``: proc(5), "state"."""
    return {state for one in usages for state in (one.state, *_states_of_threads(one))}


def _states_of_threads(usage: Usage) -> Iterator[str]:
    if usage.threads == 1:
        return
    # They may end meanwhile.
    with contextlib.suppress(OSError):
        for name in os.listdir(f"{_PROC}/{usage.pid}/task"):  # noqa: PTH208  often
            thread = usage_at(int(name), f"{_PROC}/{usage.pid}/task")
            if thread is not None:
                yield thread.state


class IdleCpu:
    """Time in which the CPUs that this process may use had nothing to do."""

    def __init__(self) -> None:
        self._cpus = os.sched_getaffinity(0)
        self.cpus = len(self._cpus)
        # A container's /proc/stat (lxcfs) calls a CPU idle that another container uses.
        self._is_known = not os.path.ismount(f"{_PROC}/stat")

    def ticks(self) -> int:
        """What it is so far, with waits for a disk; 0 where it is not known."""
        if not self._is_known:
            return 0
        try:
            return idle_ticks(read_proc(f"{_PROC}/stat").decode("ascii"), self._cpus)
        except (OSError, ValueError, IndexError):
            return 0


def idle_ticks(stat: str, cpus: Iterable[int]) -> int:
    """Ticks in which CPUs ran no process: idle, waits for a disk, and packets (softirq).

    Where the kernel counts packets apart, they are no time of the process that floods a port.
    """
    wanted = {f"cpu{number}" for number in cpus}
    # Another line has a number for each interrupt of the machine.
    rows = (line.split() for line in stat.splitlines() if line.startswith("cpu"))
    return sum(int(row[4]) + int(row[5]) + int(row[7]) for row in rows if row[0] in wanted)


def memory_bytes(usages: Sequence[Usage], enough: int, hidden: int = 0) -> int:
    """Memory of processes, pages that they share counted once.

    Args:
        enough: Below this a quick upper bound is returned, that counts shared pages several times.
    """
    upper = sum(usage.resident_bytes for usage in usages) + hidden
    return upper if upper <= enough else hidden + sum(_proportional_bytes(one) for one in usages)


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
    seen = 0
    for usage in usages:
        mapped = _shared_memory(usage.pid)
        if mapped:
            seen += _proportional_bytes(usage, b"Pss_Shmem:")
        for inode, size in mapped.items():
            sizes[inode] = max(size, sizes.get(inode, 0))
    return max(0, sum(sizes.values()) - seen)


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


def usage_at(pid: int, folder: str = _PROC) -> Usage | None:
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


def _shared_bytes() -> int:
    """No less than all shared memory that this machine holds: see proc_meminfo(5)."""
    try:
        text = read_proc(f"{_PROC}/meminfo")
        found = dict(re.findall(rb"^(\w+):\s*(\d+) kB$", text, re.MULTILINE))
        # Whose the swapped pages are is not said there.
        swapped = int(found[b"SwapTotal"]) - int(found[b"SwapFree"])
        return 1024 * (int(found[b"Shmem"]) + swapped)
    except (OSError, KeyError):
        return sys.maxsize


def _shared_memory(pid: int) -> dict[bytes, int]:
    """Anonymous memory that a process has mapped to be shared: inode -> where it ends there."""
    found: dict[bytes, int] = {}
    try:
        with open(f"{_PROC}/{pid}/maps", "rb") as file:  # noqa: PTH123  often
            text = file.read()
        # What proc(5) calls such memory, which has no file; few processes have any.
        for line in text.splitlines() if _SHARED in text else ():
            if line.endswith(_SHARED):
                place, _, offset, _, inode = line.split()[:5]
                begin, end = (int(number, 16) for number in place.split(b"-"))
                size = int(offset, 16) + end - begin
                found[inode] = max(size, found.get(inode, 0))
    except (OSError, ValueError):
        # It has ended.
        return {}
    return found


def _open_files(pid: int) -> int:
    folder = f"{_PROC}/{pid}/fd"
    try:
        # Since Linux 6.2 this is their number (proc(5)); before, it was 0.
        return os.stat(folder).st_size or len(os.listdir(folder))  # noqa: PTH116, PTH208  often
    except PermissionError:
        # For how many it has room, which no process can hide.
        with contextlib.suppress(OSError):
            text = read_proc(f"{_PROC}/{pid}/status")
            found = re.search(rb"^FDSize:\s*(\d+)$", text, re.MULTILINE)
            return int(found[1]) if found else 0
    except OSError:
        pass
    return 0


def _in_flight(pid: int) -> int:
    folder = f"{_PROC}/{pid}/fd"
    found = 0
    # It may have ended, keep to itself what it has open, or close any of it meanwhile.
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):  # noqa: PTH208  often
            with contextlib.suppress(FileNotFoundError):
                if os.readlink(f"{folder}/{name}").startswith("socket:"):  # noqa: PTH115  often
                    text = read_proc(f"{folder}info/{name}")
                    number = re.search(rb"^scm_fds:\s*(\d+)$", text, re.MULTILINE)
                    found += int(number[1]) if number else 0
    return found


def _proportional_bytes(usage: Usage, what: bytes = b"Pss:") -> int:
    try:
        with open(f"{_PROC}/{usage.pid}/smaps_rollup", "rb") as file:  # noqa: PTH123  often
            for line in file:
                if line.startswith(what):
                    return int(line.split()[1]) * 1024
    except (OSError, IndexError):
        return usage.resident_bytes
    return 0
