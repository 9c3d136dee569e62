"""A process that has imported what every cell imports, and forks into cells.

``python -m grader.run.cell.prefork_server SOCKET`` reads requests from the socket that it
inherits as that descriptor. Interpreter start, imports and loading of the DDS libraries are most
of what a cell costs; here they are paid once for all cells of a batch. It never imports anything
of a student's, and has no node or thread of its own, so that a fork of it is a whole process.
"""

from __future__ import annotations

import compileall
import contextlib
import ctypes
import errno
import gc
import importlib
import json
import math
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.machine.ros import RosInstallation
from grader.machine.scratch import Scratch
from grader.run.cell.middleware_hang import HangMonitor
from grader.run.environment import RMW, TRACER, TRACER_IN_SANDBOX, cell_environment
from grader.run.process.descendants import descendant_pids, is_stopped, kill_tree, send
from grader.sandbox import bubblewrap
from grader.sandbox.bubblewrap import Bind
from grader.sandbox.namespaces import CELL, enter

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

STATUS = struct.Struct("=id")
"""A report on a cell: process id and 0, then exit status and CPU time in seconds."""
_REQUEST_BYTES = 65_536
_IN_FLIGHT_S, _IN_FLIGHT_POLL_S = 10.0, 0.02
_CLOSING_LIMIT_S = 20.0
"""More than a cell may take to end what it started."""
_STOPPED_S = 3.0
"""Time between two looks for stopped processes; a cell ends its student's in that time."""
_ORPHANED_LIMIT_S = 30.0
"""More than the runner waits before it kills cells itself."""
_ALWAYS = (
    "grader.run.cell.main",
    "rcl_interfaces/msg/Log",
    "rcl_interfaces/srv/ListParameters",
)
SIMULATOR_MODULE = "grader.run.cell.simulator"
"""Module that a cell with a simulated robot imports in addition."""
TURTLES_MODULE = "grader.run.cell.turtles"
"""The same for turtles."""
AUTHOR_SIMULATOR_MODULE = "grader.run.cell.author_simulator"
"""The same for a simulator of the author's."""


def readable(descriptors: Collection[int], limit_s: float | None = None) -> set[int]:
    """Wait until descriptors can be read or have ended; any number of them, unlike select(2)."""
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    found = poll.poll(None if limit_s is None else math.ceil(1000 * limit_s))
    return {descriptor for descriptor, _ in found}


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
        self._seen = _seen_of(sandbox)
        self._cells = Scratch("cells")
        underlays = sandbox.underlays() if sandbox is not None else []
        self.shown = {bind.source: bind.target for bind in underlays}
        command = [str(ros.python), "-m", "grader.run.cell.prefork_server", str(theirs.fileno())]
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
    def is_alive(self) -> bool:
        """Whether it still takes requests, and its cells see what is in the cache now."""
        return self._popen.poll() is None and self._seen == _seen_of(self._sandbox)

    @property
    def cells(self) -> Path:
        """Where the folders of its cells are made."""
        return self._cells.path

    def request(self, request: dict[str, Any], descriptors: list[int]) -> None:
        """Ask for a cell with these descriptors: 0, 1, 2 and one for the reports on it."""
        data = json.dumps({**request, "private": self._sandbox is not None}).encode()
        deadline = time.monotonic() + _IN_FLIGHT_S
        while True:
            try:
                socket.send_fds(self._socket, [data], descriptors)
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
            self._socket.send(json.dumps({"kill": pid}).encode())

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


def _seen_of(sandbox: Sandbox | None) -> list[tuple[int, int]]:
    """Identities of what a sandbox shows of the cache, which change when it is made anew."""
    found = [path.stat() for path in sandbox.cached] if sandbox is not None else []
    return [(status.st_dev, status.st_ino) for status in found]


def _serve(requests: socket.socket) -> None:
    """Fork a cell for each request, and report how each ended, until the runner has gone."""
    running: dict[int, int] = {}
    ended_read, ended_write = os.pipe()
    os.set_blocking(ended_read, False)
    os.set_blocking(ended_write, False)
    signal.set_wakeup_fd(ended_write, warn_on_full_buffer=False)
    signal.signal(signal.SIGCHLD, lambda _number, _frame: None)
    sources = [requests.fileno(), ended_read]
    reported_s = 0.0
    # Without a runner the cells that run are still waited for, but not those that hang.
    limit_s: float | None = None
    while len(sources) > 1 or running:
        ready = readable(sources, limit_s)
        if not ready:
            for pid in running:
                kill_tree(pid)
            limit_s = None
        if ended_read in ready:
            with contextlib.suppress(BlockingIOError):
                os.read(ended_read, 4096)
            own_s = time.process_time()
            if _report_ended(running, own_s - reported_s):
                reported_s = own_s
        if requests.fileno() in ready:
            text, descriptors, _, _ = socket.recv_fds(requests, _REQUEST_BYTES, 4)
            request = json.loads(text) if text else {}
            if request.get("kill") in running:
                os.kill(request["kill"], signal.SIGKILL)
            elif "arguments" in request:
                _fork(requests, request, descriptors, running)
            elif not text:
                sources.remove(requests.fileno())
                limit_s = _ORPHANED_LIMIT_S


def _fork(
    requests: socket.socket,
    request: dict[str, Any],
    descriptors: list[int],
    running: dict[int, int],
) -> None:
    _import(request["imports"])
    *standard, status = descriptors
    pid = os.fork()
    if pid == 0:
        requests.close()
        _become_cell(request["arguments"], standard, private=request["private"])
    for descriptor in standard:
        os.close(descriptor)
    running[pid] = status
    # The runner may be gone; the cell notices it as well.
    with contextlib.suppress(BrokenPipeError):
        os.write(status, STATUS.pack(pid, 0.0))


def _report_ended(running: dict[int, int], own_s: float) -> bool:
    """Report each cell that has ended; the server's own CPU time counts for the first one."""
    has_reported = False
    with contextlib.suppress(ChildProcessError):
        while True:
            pid, status, usage = os.wait4(-1, os.WNOHANG)
            if not pid:
                break
            descriptor = running.pop(pid)
            cpu_s = usage.ru_utime + usage.ru_stime + (0.0 if has_reported else own_s)
            has_reported = True
            with contextlib.suppress(BrokenPipeError):
                os.write(descriptor, STATUS.pack(os.waitstatus_to_exitcode(status), cpu_s))
            os.close(descriptor)
    return has_reported


def _become_cell(arguments: list[str], descriptors: list[int], *, private: bool) -> None:
    """Run a cell in this process, which was just forked, and end it."""
    status = 1
    try:
        from grader.run.cell.main import main

        os.setsid()
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for target, descriptor in enumerate(descriptors):
            os.dup2(descriptor, target)
        # Of a class on a large machine there are hundreds, one for each cell that runs.
        for name in os.listdir("/proc/self/fd"):  # noqa: PTH208
            if int(name) > 2:
                with contextlib.suppress(OSError):
                    os.close(int(name))
        folder, rights = Path(arguments[0]), None
        if private:
            # Run by the process that waits for the cell: the cell itself cannot while it hangs.
            monitor = HangMonitor(Path("/proc/1"))
            rights = enter(folder, monitor.signal_to_send)
            folder = CELL
        status = main(folder, tuple(map(int, arguments[1:])), rights)
        sys.stdout.flush()
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
    finally:
        os._exit(status)


def _import(names: Sequence[str]) -> None:
    """Import modules, and interfaces such as ``std_msgs/msg/String`` with their type support."""
    for name in names:
        # The cell imports it again and says what is wrong with it.
        with contextlib.suppress(Exception):
            package, *path = name.split("/")
            module = importlib.import_module(".".join((package, *path[:-1])))
            if path:
                getattr(module, path[-1]).__import_type_support__()


def main(descriptor: int) -> int:
    """Import, then serve."""
    # A shell starts background jobs, and `nohup` its command, with some signals of a terminal
    # ignored; a student's process that inherits that never sees the Ctrl-C that ends it.
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    # Python 3.12 warns of every fork beside other threads. These two are LTTng-UST's, which come
    # with rclpy's tracetools, only wait, and belong to none of the locks that a cell takes.
    warnings.filterwarnings("ignore", ".*use of fork", DeprecationWarning)
    # rclpy opens the middleware with its first node; to relocate it is half of that.
    with contextlib.suppress(OSError):
        ctypes.CDLL(f"lib{RMW}.so")
    _import(_ALWAYS)
    # Pages that the collector touches would be copied by every fork.
    gc.collect()
    gc.freeze()
    with socket.socket(fileno=descriptor) as requests:
        _serve(requests)
    return 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
