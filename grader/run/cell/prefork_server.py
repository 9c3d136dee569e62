"""The prefork server as the runner sees it: a process that forks into cells.

What it does is in :mod:`grader.run.cell.prefork_process`.
"""

from __future__ import annotations

import compileall
import contextlib
import errno
import signal
import socket
import subprocess
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.machine.ros import RosInstallation
from grader.machine.scratch import Scratch
from grader.run.cell.prefork_protocol import send_request
from grader.run.environment import TRACER, TRACER_IN_SANDBOX, cell_environment
from grader.run.process.descendants import descendant_pids, is_stopped, kill_tree, send
from grader.sandbox import bubblewrap
from grader.sandbox.bubblewrap import Bind

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

_IN_FLIGHT_S, _IN_FLIGHT_POLL_S = 10.0, 0.02
_CLOSING_LIMIT_S = 20.0
"""More than a cell may take to end what it started."""
_STOPPED_S = 3.0
"""Time between two looks for stopped processes; a cell ends its student's in that time."""


class PreforkServer:
    """The process, as the runner sees it; it begins to import at once.

    Args:
        sandbox: What it and its cells run in, or None.

    Attributes:
        shown: Underlays that its cells see, and where.
    """

    def __init__(self, ros: RosInstallation, sandbox: Sandbox | None = None) -> None:
        # In a sandbox, Python would compile the tracer at each start of a program.
        compileall.compile_dir(TRACER, quiet=2)
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._sandbox = sandbox
        self._cached = _identities(sandbox)
        self._cells = Scratch("cells")
        underlays = sandbox.underlays() if sandbox is not None else []
        self.shown = {bind.source: bind.target for bind in underlays}
        command = [str(ros.python), "-m", "grader.run.cell.prefork_process", str(theirs.fileno())]
        environment = cell_environment(ros, sandboxed=sandbox is not None)
        if sandbox is not None:
            bubblewrap.give(self.cells)
            shown = [Bind(TRACER, TRACER_IN_SANDBOX), *underlays]
            command = sandbox.server_command(command, ros, self.cells, environment, shown)
            environment = bubblewrap.PLAIN_ENVIRONMENT
        with theirs:
            self._popen = subprocess.Popen(
                command,
                # Python imports from where it is started, before all else.
                cwd="/",
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )
        self._closed = threading.Event()
        threading.Thread(target=self._end_stopped, name="stopped cells", daemon=True).start()

    @property
    def is_usable(self) -> bool:
        """Whether it still takes requests, and its cells see what is in the cache now."""
        return self._popen.poll() is None and self._cached == _identities(self._sandbox)

    @property
    def cells(self) -> Path:
        """Where the folders of its cells are made."""
        return self._cells.path

    def request(self, request: dict[str, Any], descriptors: list[int]) -> None:
        """Ask for a cell with these descriptors: 0, 1, 2 and one for the reports on it."""
        request = {**request, "private": self._sandbox is not None}
        deadline = time.monotonic() + _IN_FLIGHT_S
        while True:
            try:
                send_request(self._socket, request, descriptors)
                return
            except OSError as error:
                # Some submission has too many descriptors in flight, and is ended for it.
                if error.errno != errno.ETOOMANYREFS or time.monotonic() > deadline:
                    raise
            time.sleep(_IN_FLIGHT_POLL_S)

    def give(self, folder: Path) -> None:
        """Let a cell read and write all that is in its folder."""
        if self._sandbox is not None:
            bubblewrap.give(folder)

    def kill(self, pid: int) -> None:
        """SIGKILL a cell and all that descends from it."""
        if self._sandbox is None:
            kill_tree(pid)
            return
        # In a sandbox it counts processes in its own way. Without it the cell is gone as well.
        with contextlib.suppress(OSError):
            send_request(self._socket, {"kill": pid}, [])

    def close(self, limit_s: float = _CLOSING_LIMIT_S) -> None:
        """Wait for the cells that it has forked, and for itself, to end."""
        self._socket.close()
        send(signal.SIGKILL, self._stopped())
        try:
            self._popen.wait(limit_s)
        except subprocess.TimeoutExpired:
            kill_tree(self._popen.pid)
            self._popen.wait()
        self._closed.set()
        self._cells.remove()

    def _end_stopped(self) -> None:
        """Kill this process or a cell that a signal such as SIGSTOP has stopped: it would hang."""
        before: frozenset[int] = frozenset()
        while not self._closed.wait(_STOPPED_S):
            stopped = self._stopped()
            send(signal.SIGKILL, stopped & before)
            before = stopped

    def _stopped(self) -> frozenset[int]:
        pids = (self._popen.pid, *descendant_pids(self._popen.pid))
        return frozenset(filter(is_stopped, pids))


def _identities(sandbox: Sandbox | None) -> list[tuple[int, int]]:
    """Device and inode of what a sandbox shows of the cache, which change when it is made anew."""
    if sandbox is None:
        return []
    return [(status.st_dev, status.st_ino) for status in map(Path.stat, sandbox.cached)]
