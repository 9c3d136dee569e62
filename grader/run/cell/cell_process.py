"""The process of a cell, as the runner sees it."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from grader.errors import GraderFault
from grader.run.cell.middleware_hang import ENDED_BY, MiddlewareHung
from grader.run.cell.prefork_protocol import Report, read_report, readable
from grader.run.cell.prefork_server import PreforkServer
from grader.run.order import GO, ORDER_FILE, RECORDING_FILE, CellOrder
from grader.run.process.descendants import kill_by_variable

_ENDING_LIMIT_S = 10.0
# Longer than all bounded waits of a cell, even stretched by a busy host: the cell hangs.
_HANGING_S = 600.0
_SHOWN_ERROR = 4000
SCRATCH = "scratch"
"""Folder of the student's processes, their HOME, in the cell's."""


class CellProcess:
    """A cell that is getting ready, and then runs one order.

    Args:
        imports: More modules and interfaces to import, only of rosgrade and of ROS.

    Attributes:
        folder: Its own; gone after :meth:`close`.
        shown: Underlays that it sees without a copy, and where.
        pid: As the prefork server counts processes; None before the fork.
        returncode: As in :mod:`subprocess`, or None while it runs.
        cpu_s: CPU time of the cell, of the student in it and of the prefork server for it; known at
            its end.
    """

    def __init__(self, prefork_server: PreforkServer, imports: Sequence[str] = ()) -> None:
        self._server = prefork_server
        self.shown = prefork_server.shown
        self._closing, self._waiting = threading.Lock(), threading.Lock()
        self.pid: int | None = None
        self.returncode: int | None = None
        self.cpu_s = 0.0
        self._temporary = tempfile.TemporaryDirectory(prefix="cell-", dir=prefork_server.cells)
        self.folder = Path(self._temporary.name)
        self._errors = self.folder / "stderr.txt"
        own_domain = os.environ.get("ROS_DOMAIN_ID", "")
        avoid = [own_domain] if own_domain.isdigit() else []
        request = {"arguments": [str(self.folder), *avoid], "imports": list(imports)}
        in_read, in_write = os.pipe()
        out_read, out_write = os.pipe()
        self._reports, reports_write = os.pipe()
        theirs = (in_read, out_write, reports_write)
        try:
            with self._errors.open("wb") as errors:
                self._server.give(self.folder)
                descriptors = [in_read, out_write, errors.fileno(), reports_write]
                self._server.request(request, descriptors)
        except OSError as error:
            for descriptor in (in_write, out_read, self._reports):
                os.close(descriptor)
            raise GraderFault(f"the process starting runs has ended: {error.strerror}") from error
        finally:
            for descriptor in theirs:
                os.close(descriptor)
        self._stdin, self._stdout = os.fdopen(in_write, "wb"), os.fdopen(out_read)

    @property
    def recording(self) -> Path:
        """Path of the recording that it writes."""
        return self.folder / RECORDING_FILE

    def run(self, order: CellOrder) -> Iterator[Mapping[str, Any]]:
        """Run an order and yield the events of its progress.

        Raises:
            MiddlewareHung: The student's processes kept its middleware busy.
            GraderFault: The cell failed, through no fault of the student's.
        """
        (self.folder / ORDER_FILE).write_bytes(order.to_bytes())
        self._server.give(self.folder)
        watchdog = threading.Timer(_HANGING_S, self._kill)
        watchdog.daemon = True
        watchdog.start()
        try:
            # It may have died or been abandoned: its status and last words tell more.
            with contextlib.suppress(BrokenPipeError, ValueError):
                self._stdin.write(GO)
                self._stdin.flush()
            for line in self._stdout:
                yield json.loads(line)
        finally:
            watchdog.cancel()
            self._end()
            if self.returncode:
                # Killed, perhaps by the student's process, before it could clean up.
                kill_by_variable("HOME", str(self.folder / SCRATCH))
        if self.returncode == -ENDED_BY:
            raise MiddlewareHung
        # A cell that was taken over must not make us read what it points to.
        if self.returncode or not self.recording.is_file() or self.recording.is_symlink():
            ended = f"the run of scenario {order.scenario!r} ended with status {self.returncode}"
            if self.returncode == -signal.SIGKILL:
                ended += " (it was killed, or stopped by a signal such as SIGSTOP)"
            last_words = self._errors.read_text(encoding="utf-8", errors="replace").strip()
            raise GraderFault(f"{ended}:\n{last_words[-_SHOWN_ERROR:]}" if last_words else ended)

    def abandon(self) -> None:
        """Make it kill the processes that it started, and end; returns at once."""
        # Called by the interrupting and by the waiting thread, perhaps at the same time.
        with self._closing, contextlib.suppress(OSError):
            if not self._stdin.closed:
                self._stdin.close()

    def close(self) -> None:
        """End it and remove its folder."""
        self._end()
        self._temporary.cleanup()

    def _end(self) -> None:
        self.abandon()
        try:
            self._wait(_ENDING_LIMIT_S)
        except subprocess.TimeoutExpired:
            self._kill()
            self._wait(None)
        self._stdout.close()

    def _wait(self, limit_s: float | None) -> None:
        with self._waiting:
            if self.returncode is None:
                self.await_fork(limit_s)
                # There is no status when the prefork server itself was killed.
                ended = self._await_report(limit_s) or Report(-signal.SIGKILL, 0.0)
                self.returncode, self.cpu_s = ended
                os.close(self._reports)

    def _kill(self) -> None:
        with self._waiting:
            if self.returncode is None:
                self.await_fork(_ENDING_LIMIT_S)
                if self.pid is not None:
                    self._server.kill(self.pid)

    def await_fork(self, limit_s: float | None = None) -> None:
        """Wait until :attr:`pid` is known, or the prefork server has ended."""
        if self.pid is None:
            started = self._await_report(limit_s)
            self.pid = started and started.value

    def _await_report(self, limit_s: float | None) -> Report | None:
        if not readable((self._reports,), limit_s):
            raise subprocess.TimeoutExpired("cell", limit_s or 0.0)
        return read_report(self._reports)
