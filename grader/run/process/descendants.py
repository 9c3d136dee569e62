"""Processes and what came of them, read from /proc."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import time
from collections.abc import Iterable
from pathlib import Path

_PR_SET_CHILD_SUBREAPER = 36
_PROC = Path("/proc")
_LONGEST_COMMAND = 1000


def become_subreaper() -> None:
    """Make orphaned descendants our children, so that none can leave us by forking twice.

    Source: prctl(2), PR_SET_CHILD_SUBREAPER.
    """
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def descendants(of: int) -> dict[int, str]:
    """All living descendants of a process."""
    children: dict[int, list[int]] = {}
    for entry in os.listdir("/proc"):  # noqa: PTH208  names only, and often
        if entry.isdigit():
            parent = _parent(entry, of_zombie=False)
            if parent is not None:
                children.setdefault(parent, []).append(int(entry))
    found: dict[int, str] = {}
    queue = children.get(of, [])
    while queue:
        pid = queue.pop()
        found[pid] = command_line(pid)
        queue.extend(children.get(pid, ()))
    return found


class Family:
    """The descendants of a process, for those who ask often: only new processes are read."""

    def __init__(self, of: int) -> None:
        """Nothing is known yet.

        Args:
            of: Id of the process; it adopts orphans of its descendants.
        """
        self._of = of
        self._members: set[int] = set()
        self._others: set[int] = set()

    def look(self) -> frozenset[int]:
        """Ids of those that are there now; of zombies too, which nobody has waited for yet."""
        present = {int(name) for name in os.listdir("/proc") if name.isdigit()}  # noqa: PTH208
        self._members &= present
        self._others &= present
        parents = {pid: _parent(str(pid)) for pid in present - self._members - self._others}
        while new := {pid for pid, parent in parents.items() if self._is_member(parent)}:
            self._members |= new
            parents = {pid: parent for pid, parent in parents.items() if pid not in new}
        self._others |= parents.keys()
        return frozenset(self._members)

    def _is_member(self, pid: int | None) -> bool:
        return pid == self._of or pid in self._members


def _parent(pid: str, *, of_zombie: bool = True) -> int | None:
    """Parent of a process, or None for one that has ended."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:  # noqa: PTH123  a scan of all processes
            stat = file.read()
    except OSError:
        return None
    # The command stands in parentheses and may contain anything; the rest is plain words.
    state, parent = stat[stat.rindex(b")") + 2 :].split(b" ", 2)[:2]
    return int(parent) if of_zombie or state not in (b"Z", b"X") else None


def is_stopped(pid: int) -> bool:
    """Whether a signal such as SIGSTOP has stopped a process, so that it waits for SIGCONT."""
    try:
        stat = (_PROC / str(pid) / "stat").read_bytes()
    except OSError:
        return False
    return stat[stat.rindex(b")") + 2 :].startswith(b"T")


def command_line(pid: int) -> str:
    """Command line of a process, for people: of a very long one the beginning."""
    try:
        with (_PROC / str(pid) / "cmdline").open("rb") as file:
            line = file.read(_LONGEST_COMMAND).replace(b"\0", b" ").strip()
        return (line or (_PROC / str(pid) / "comm").read_bytes().strip()).decode(errors="replace")
    except OSError:
        return f"process {pid}"


def is_init(pid: int) -> bool:
    """Whether a process is the first one of a PID namespace below ours (see proc(5), NSpid)."""
    try:
        status = (_PROC / str(pid) / "status").read_text(errors="replace")
    except OSError:
        return False
    numbers = status.partition("NSpid:")[2].partition("\n")[0].split()
    return len(numbers) > 1 and numbers[-1] == "1"


def kill_descendants(of: int, *, limit_s: float = 5.0) -> dict[int, str]:
    """SIGKILL every descendant until none is left.

    New ones may be forked while we kill, so this repeats; they are stopped first.
    """
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
    while True:
        try:
            pid, _ = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if pid == 0:
            return


def kill_by_variable(name: str, value: str, *, limit_s: float = 5.0) -> None:
    """SIGKILL every process that was started with a variable of this value.

    For what a cell left behind that was killed itself: its processes are nobody's descendants.

    Args:
        value: Its value; unique to what is to be killed.
    """
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
