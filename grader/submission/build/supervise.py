"""Run one command and leave nothing of it behind: ``supervise.py COMMAND...``.

A script of its own that imports nothing of rosgrade, so it starts quickly. It becomes the parent
of every orphan below it (``PR_SET_CHILD_SUBREAPER``); so daemons are found in any process group
or session they made for themselves. It kills them when the command has ended, or when its own
standard input is closed, which also happens when its caller dies.

It ends as the command did: with its exit status, or by the same signal.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import select
import signal
import subprocess
import sys
import time

_PR_SET_CHILD_SUBREAPER = 36
_KILL_S = 10.0
_GIB = 2**30


def descendants() -> set[int]:
    """Process ids of all processes below this one."""
    children: dict[int, list[int]] = {}
    for name in os.listdir("/proc"):  # noqa: PTH208 - pathlib takes as long to import as this runs
        # A process may be gone by now.
        with contextlib.suppress(OSError, ValueError):
            with open(f"/proc/{int(name)}/stat", "rb") as file:  # noqa: PTH123 - as above
                # The command's name may contain anything, but the last ")" ends it.
                parent = int(file.read().rpartition(b")")[2].split()[1])
            children.setdefault(parent, []).append(int(name))
    found: set[int] = set()
    pending = [os.getpid()]
    while pending:
        below = set(children.get(pending.pop(), ())) - found
        found |= below
        pending += below
    return found


def kill_all() -> None:
    """Kill every descendant, and those that they start meanwhile."""
    deadline = time.monotonic() + _KILL_S
    while time.monotonic() < deadline:
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        left = descendants()
        if not left:
            return
        # Stopped first, so that a fork bomb cannot outrun the killing.
        for number in (signal.SIGSTOP, signal.SIGKILL):
            for pid in left:
                with contextlib.suppress(OSError):
                    os.kill(pid, number)
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


def run(command: list[str]) -> int:
    """Run the command until one of both ends; its status, or minus the signal that ended it."""
    try:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    except OSError as error:
        os.write(2, f"{command[0]}: {error}\n".encode(errors="replace"))
        return 127
    ended = os.pidfd_open(process.pid)
    ready, _, _ = select.select([0, ended], [], [])
    return process.wait() if ended in ready else -signal.SIGKILL


def main(command: list[str]) -> None:
    """Run the command, kill what is left, end as it did."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    limit()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # Ctrl-C in the terminal reaches the caller, who closes the standard input of this process.
        signal.signal(number, signal.SIG_IGN)
    status = run(command)
    kill_all()
    if status < 0:
        if -status not in (signal.SIGKILL, signal.SIGSTOP):
            signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    os._exit(status)


if __name__ == "__main__":
    main(sys.argv[1:])
