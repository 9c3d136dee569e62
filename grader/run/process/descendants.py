"""Descendants of a process, read from /proc, and shared memory that killed nodes leave.

Fast DDS removes its segments only at a clean end. A living participant holds a lock on
``fastrtps_<hex>_el`` beside each of its segments in /dev/shm; without one the owner is dead.
``fastdds shm clean`` decides in the same way.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import os
import re
import signal
import time
from collections.abc import Iterable
from pathlib import Path

from grader.sandbox.proc import read_proc

_PR_SET_CHILD_SUBREAPER = 36
_PROC = Path("/proc")
_LONGEST_COMMAND = 1000


def become_subreaper() -> None:
    """Make orphaned descendants children of this process (prctl(2)), also after a double fork."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def descendants(of: int) -> dict[int, str]:
    """Command lines of all living descendants of a process."""
    return {pid: command_line(pid) for pid in descendant_pids(of)}


def descendant_pids(of: int) -> list[int]:
    """Ids of the living descendants of a process."""
    children: dict[int, list[int]] = {}
    for entry in filter(str.isdigit, os.listdir("/proc")):  # noqa: PTH208  names only, and often
        parent = _parent(entry, of_zombie=False)
        if parent is not None:
            children.setdefault(parent, []).append(int(entry))
    found: list[int] = []
    pending = children.get(of, [])
    while pending:
        found.append(pending.pop())
        pending += children.get(found[-1], [])
    return found


class Family:
    """The descendants of a process, looked at often: only new processes are read."""

    def __init__(self, of: int) -> None:
        self._of = of
        self._members: set[int] = set()
        self._others: set[int] = set()

    def look(self) -> frozenset[int]:
        """Ids of those that are there now; of zombies too, which were not waited for yet."""
        present = {int(name) for name in os.listdir("/proc") if name.isdigit()}  # noqa: PTH208
        self._members &= present
        self._others &= present
        parents = {pid: _parent(str(pid)) for pid in present - self._members - self._others}
        own = {self._of, *self._members}
        while new := {pid for pid, parent in parents.items() if parent in own} - own:
            own |= new
        self._members = own - {self._of}
        self._others |= parents.keys() - own
        return frozenset(self._members)


def _parent(pid: str, *, of_zombie: bool = True) -> int | None:
    try:
        # The command's name may contain anything, but the last ")" ends it.
        state, parent, *_ = read_proc(f"/proc/{pid}/stat").rpartition(b") ")[2].split()
    except (OSError, ValueError):
        return None
    return int(parent) if of_zombie or state not in (b"Z", b"X") else None


def is_stopped(pid: int) -> bool:
    """Whether a signal such as SIGSTOP has stopped a process, so that it waits for SIGCONT."""
    try:
        return read_proc(f"/proc/{pid}/stat").rpartition(b") ")[2].startswith(b"T")
    except OSError:
        return False


def command_line(pid: int) -> str:
    """Command line of a process, for people: of a very long one the beginning."""
    try:
        with (_PROC / str(pid) / "cmdline").open("rb") as file:
            line = file.read(_LONGEST_COMMAND).replace(b"\0", b" ").strip()
        return (line or (_PROC / str(pid) / "comm").read_bytes().strip()).decode(errors="replace")
    except OSError:
        return f"process {pid}"


def pid_within(pid: int) -> int | None:
    """Id of a process in the PID namespace that it is in, below this one (proc(5), NSpid)."""
    try:
        status = (_PROC / str(pid) / "status").read_text(errors="replace")
    except OSError:
        return None
    numbers = status.partition("NSpid:")[2].partition("\n")[0].split()
    return int(numbers[-1]) if len(numbers) > 1 else None


def kill_descendants(of: int, *, limit_s: float = 5.0) -> dict[int, str]:
    """SIGKILL every descendant, which are stopped first, until none is left."""
    killed: dict[int, str] = {}
    deadline = time.monotonic() + limit_s
    while (alive := descendants(of)) and time.monotonic() < deadline:
        # One that is dying has lost its command line: the first look counts.
        killed = {**alive, **killed}
        for number in (signal.SIGSTOP, signal.SIGKILL):
            send(number, alive)
        reap()
    reap()
    return killed


def kill_tree(pid: int) -> None:
    """SIGKILL a process and everything that descends from it now."""
    send(signal.SIGKILL, (pid, *descendants(pid)))


def send(number: signal.Signals, pids: Iterable[int]) -> None:
    """Send a signal to processes, as far as they are still there."""
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)


def reap() -> None:
    """Take the exit status of ended children that no Popen object waits for."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def kill_by_variable(name: str, value: str, *, limit_s: float = 5.0) -> None:
    """SIGKILL processes that a killed cell left behind, found by an environment variable."""
    wanted = f"{name}={value}".encode()
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        names = os.listdir("/proc")  # noqa: PTH208
        found = [int(name) for name in names if name.isdigit() and _holds(name, wanted)]
        if not found:
            return
        send(signal.SIGKILL, found)
        time.sleep(0.01)


def _holds(pid: str, wanted: bytes) -> bool:
    try:
        return wanted in (_PROC / pid / "environ").read_bytes().split(b"\0")
    except OSError:
        return False


_SHARED_MEMORY = Path("/dev/shm")
_LOCK = re.compile(r"fastrtps_[0-9a-f]{16}_el")
# A participant makes the file before it locks it.
_YOUNGEST_S = 1.0


def remove_orphaned_segments() -> None:
    """Remove the segments of this user's dead participants."""
    for lock in _SHARED_MEMORY.glob("fastrtps_*_el"):
        if _LOCK.fullmatch(lock.name) and _is_orphaned(lock):
            lock.with_name(lock.name.removesuffix("_el")).unlink(missing_ok=True)
            lock.unlink(missing_ok=True)


def _is_orphaned(lock: Path) -> bool:
    try:
        status = lock.stat()
        if status.st_uid != os.getuid() or time.time() - status.st_ctime < _YOUNGEST_S:
            return False
        with lock.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
