"""Run one command and leave nothing of it behind: ``supervise.py STATUS_FD COMMAND...``.

A script of its own that imports nothing of ours, so that it starts in milliseconds. It becomes
the parent of every orphan below it (``PR_SET_CHILD_SUBREAPER``); so daemons are found whatever
process group or session they made for themselves, and it kills them when the command has ended,
or when its own standard input is closed, which also happens when its caller dies.

It writes how the command ended to STATUS_FD: ``exit N``, ``signal N``, or ``closed``.
"""

from __future__ import annotations

import ctypes
import os
import resource
import select
import signal
import sys
import time

_PR_SET_CHILD_SUBREAPER = 36
_KILL_S = 10.0
_GIB = 2**30


def descendants() -> set[int]:
    """Process ids of all processes below this one that are not yet reaped."""
    children: dict[int, list[int]] = {}
    for name in os.listdir("/proc"):  # noqa: PTH208 - pathlib takes as long to import as this runs
        if not name.isdigit():
            continue
        try:
            with open(f"/proc/{name}/stat", "rb") as file:  # noqa: PTH123 - as above
                # The command's name may contain anything, but the last ")" ends it.
                fields = file.read().rpartition(b")")[2].split()
        except OSError:
            continue
        children.setdefault(int(fields[1]), []).append(int(name))
    found: set[int] = set()
    pending = [os.getpid()]
    while pending:
        for child in children.get(pending.pop(), []):
            if child not in found:
                found.add(child)
                pending.append(child)
    return found


def reap(child: int) -> str:
    """Collect whoever has ended; how the command itself ended, or nothing."""
    ended = ""
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return ended
        if pid == 0:
            return ended
        if pid == child:
            signalled = os.WIFSIGNALED(status)
            number = os.WTERMSIG(status) if signalled else os.WEXITSTATUS(status)
            ended = f"signal {number}" if signalled else f"exit {number}"


def kill_all() -> None:
    """Kill every descendant, and those that they start meanwhile."""
    deadline = time.monotonic() + _KILL_S
    while time.monotonic() < deadline:
        reap(0)
        left = descendants()
        if not left:
            return
        # Stopped first, so that a fork bomb cannot outrun the killing.
        for number in (signal.SIGSTOP, signal.SIGKILL):
            for pid in left:
                try:
                    os.kill(pid, number)
                except OSError:
                    continue
        time.sleep(0.002)


def limit() -> None:
    """Bound what one process can do to the machine; a sandbox bounds them all."""
    for what, wanted in (
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_FSIZE, _GIB),
        (resource.RLIMIT_DATA, 4 * _GIB),
    ):
        hard = resource.getrlimit(what)[1]
        allowed = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        resource.setrlimit(what, (allowed, allowed))


def start(command: list[str], keep: int) -> int:
    """Start the command in a session of its own, reading nothing."""
    child = os.fork()
    if child:
        return child
    try:
        os.setsid()
        null = os.open(os.devnull, os.O_RDONLY)
        os.dup2(null, 0)
        os.set_inheritable(keep, False)
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        limit()
        os.execvpe(command[0], command, os.environ)
    except OSError as error:
        os.write(2, f"{command[0]}: {error}\n".encode(errors="replace"))
    finally:
        os._exit(127)


def main(status_fd: int, command: list[str]) -> None:
    """Run the command, wait for its end or ours, kill what is left, say how it ended."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    wake_read, wake_write = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake_write)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # Ctrl-C in the terminal reaches the caller, who closes our input.
        signal.signal(number, signal.SIG_IGN)
    child = start(command, status_fd)
    ended = ""
    while not ended:
        ready, _, _ = select.select([0, wake_read], [], [], 1.0)
        if wake_read in ready:
            os.read(wake_read, 4096)
        if 0 in ready and not os.read(0, 4096):
            ended = "closed"
        ended = reap(child) or ended
    kill_all()
    try:
        os.write(status_fd, ended.encode())
    except OSError:
        return


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
