"""The process of a cell, as whoever orders a run sees it."""

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
from grader.run.cell.prefork_server import PreforkServer
from grader.run.order import GO, ORDER_FILE, RECORDING_FILE, CellOrder
from grader.run.process.descendants import kill_by_variable

_ENDING_LIMIT_S = 10.0
# Beyond every bounded wait of a cell, even stretched by a busy host: something of ours hangs.
_HANGING_S = 600.0
_SHOWN_ERROR = 4000
SCRATCH = "scratch"
"""Folder of the student's processes, their HOME, in the cell's."""


class CellProcess:
    """A cell that is getting ready, and then runs one order.

    Attributes:
        folder: Its own; gone after :meth:`close`.
    """

    def __init__(self, prefork_server: PreforkServer, imports: Sequence[str] = ()) -> None:
        """Start it; it joins the graph while the order is still being made.

        Raises:
            GraderFault: The prefork server has ended.
        """
        self._server = prefork_server
        self._closing = threading.Lock()
        self._temporary = tempfile.TemporaryDirectory(prefix="cell-", dir=prefork_server.cells)
        self.folder = Path(self._temporary.name)
        self._errors = self.folder / "stderr.txt"
        own_domain = os.environ.get("ROS_DOMAIN_ID", "")
        with self._errors.open("wb") as errors:
            self._forked = prefork_server.start_cell(
                self.folder, errors, [own_domain] if own_domain.isdigit() else [], imports
            )

    def run(self, order: CellOrder) -> Iterator[Mapping[str, Any]]:
        """Run an order.

        Raises:
            MiddlewareHung: The student's processes kept its middleware busy.
            GraderFault: The cell failed, through no fault of the student's.
        """
        (self.folder / ORDER_FILE).write_text(order.to_json(), encoding="utf-8")
        self._server.give(self.folder)
        watchdog = threading.Timer(_HANGING_S, self._forked.kill)
        watchdog.daemon = True
        watchdog.start()
        try:
            self._say_go()
            for line in self._forked.stdout:
                yield json.loads(line)
        finally:
            watchdog.cancel()
            self._end()
            if self._forked.returncode:
                # Killed, perhaps by the student's process: nobody has cleaned up.
                kill_by_variable("HOME", str(self.folder / SCRATCH))
        if self._forked.returncode == -ENDED_BY:
            raise MiddlewareHung
        if self._forked.returncode or not self._is_recorded():
            told = self._errors.read_text(encoding="utf-8", errors="replace")
            ended = f"the cell of scenario {order.scenario!r} ended with status "
            ended += str(self._forked.returncode)
            if self._forked.returncode == -signal.SIGKILL:
                ended += " (it was killed, or stopped by a signal such as SIGSTOP)"
            # Whoever is killed, perhaps because memory ran out, has no last words.
            last_words = told[-_SHOWN_ERROR:].strip()
            raise GraderFault(f"{ended}:\n{last_words}" if last_words else ended)

    def _is_recorded(self) -> bool:
        # Whoever takes over a cell must not make us read what it points to.
        return self.recording.is_file() and not self.recording.is_symlink()

    @property
    def recording(self) -> Path:
        """The file that it leaves."""
        return self.folder / RECORDING_FILE

    @property
    def cpu_s(self) -> float:
        """CPU time of the cell and of the student in it, known when it has ended."""
        return self._forked.cpu_s

    def abandon(self) -> None:
        """Let it kill what it started and end; returns at once."""
        # Called by whoever interrupts and by the thread that waits, perhaps at the same time.
        with self._closing, contextlib.suppress(OSError):
            if not self._forked.stdin.closed:
                self._forked.stdin.close()

    def close(self) -> None:
        """End it and remove its folder."""
        self._end()
        self._temporary.cleanup()

    def _say_go(self) -> None:
        try:
            self._forked.stdin.write(GO.decode())
            self._forked.stdin.flush()
        except (BrokenPipeError, ValueError):
            # It has died or was abandoned; its status and last words tell more than this.
            return

    def _end(self) -> None:
        self.abandon()
        try:
            self._forked.wait(_ENDING_LIMIT_S)
        except subprocess.TimeoutExpired:
            self._forked.kill()
            self._forked.wait()
        self._forked.stdout.close()
