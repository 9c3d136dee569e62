"""A process that has imported what every cell imports, and forks into cells.

``python -m grader.run.cell.prefork_process SOCKET`` reads requests from the socket that it
inherits as that descriptor. Interpreter start, imports and loading of the DDS libraries are most
of what a cell costs; here they are paid once for all cells of a batch. It never imports anything
of a student's, and has no node or thread of its own, so that a fork of it is a whole process.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import os
import signal
import socket
import sys
import time
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from grader.run.cell.middleware_hang import HangMonitor
from grader.run.cell.prefork_protocol import Report, read_request, readable
from grader.run.environment import RMW
from grader.run.process.descendants import kill_tree
from grader.sandbox.namespaces import CELL, enter

_ORPHANED_LIMIT_S = 30.0
"""More than the runner waits before it kills cells itself."""
_ALWAYS = (
    "grader.run.cell.main",
    "rcl_interfaces/msg/Log",
    "rcl_interfaces/srv/ListParameters",
)


class _Server:
    """Forks a cell for each request, and reports how each ended."""

    def __init__(self, requests: socket.socket) -> None:
        self._requests = requests
        self._report_pipes: dict[int, int] = {}  # of each cell that runs, by its process id
        self._reported_s = 0.0
        self._child_ended = _wake_up_by_signal(signal.SIGCHLD)

    def serve(self) -> None:
        """Serve until the runner has gone."""
        sources = (self._requests.fileno(), self._child_ended)
        runner_is_there = True
        while runner_is_there:
            ready = readable(sources)
            if self._child_ended in ready:
                self._report_ended()
            if self._requests.fileno() in ready:
                runner_is_there = self._answer()
        self._await_orphans()

    def _answer(self) -> bool:
        """Do what one request asks; returns whether the runner is still there."""
        request, descriptors = read_request(self._requests)
        if request is None:
            return False
        if "arguments" in request:
            self._fork(request, descriptors)
        elif request["kill"] in self._report_pipes:
            os.kill(request["kill"], signal.SIGKILL)
        return True

    def _await_orphans(self) -> None:
        """Wait for the cells that still run without a runner, but not for those that hang."""
        limit_s: float | None = _ORPHANED_LIMIT_S
        while self._report_pipes:
            if not readable((self._child_ended,), limit_s):
                for pid in self._report_pipes:
                    kill_tree(pid)
                limit_s = None
            else:
                self._report_ended()

    def _fork(self, request: dict[str, Any], descriptors: list[int]) -> None:
        _import(request["imports"])
        *standard, report_pipe = descriptors
        pid = os.fork()
        if pid == 0:
            self._requests.close()
            _become_cell(request["arguments"], standard, private=request["private"])
        for descriptor in standard:
            os.close(descriptor)
        self._report_pipes[pid] = report_pipe
        # The runner may be gone; the cell notices it as well.
        with contextlib.suppress(BrokenPipeError):
            Report(pid, 0.0).send(report_pipe)

    def _report_ended(self) -> None:
        """Report each cell that has ended."""
        with contextlib.suppress(BlockingIOError):
            os.read(self._child_ended, 4096)
        with contextlib.suppress(ChildProcessError):
            while True:
                pid, status, usage = os.wait4(-1, os.WNOHANG)
                if not pid:
                    return
                cpu_s = usage.ru_utime + usage.ru_stime + self._unreported_s()
                report_pipe = self._report_pipes.pop(pid)
                with contextlib.suppress(BrokenPipeError):
                    Report(os.waitstatus_to_exitcode(status), cpu_s).send(report_pipe)
                os.close(report_pipe)

    def _unreported_s(self) -> float:
        """CPU time of this process since it was last asked: somebody has to pay for it, too."""
        used_s = time.process_time()
        unreported_s, self._reported_s = used_s - self._reported_s, used_s
        return unreported_s


def _wake_up_by_signal(number: int) -> int:
    """A descriptor that can be read after a signal has come."""
    read_end, write_end = os.pipe()
    os.set_blocking(read_end, False)
    os.set_blocking(write_end, False)
    signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
    signal.signal(number, lambda _number, _frame: None)
    return read_end


def _become_cell(arguments: list[str], standard: list[int], *, private: bool) -> None:
    """Run a cell in this process, which was just forked, and end it.

    Args:
        standard: What becomes its descriptors 0, 1 and 2.
        private: Give it namespaces of its own.
    """
    status = 1
    try:
        from grader.run.cell.main import main

        os.setsid()
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for target, descriptor in enumerate(standard):
            os.dup2(descriptor, target)
        _close_all_but_standard()
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


def _close_all_but_standard() -> None:
    """Close what the server has open: hundreds of pipes while as many cells run."""
    for name in os.listdir("/proc/self/fd"):  # noqa: PTH208
        if int(name) > 2:
            with contextlib.suppress(OSError):
                os.close(int(name))


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
        _Server(requests).serve()
    return 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
