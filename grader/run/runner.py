"""Runs scenarios, each in a cell, which is a process of its own.

This process never imports rclpy. It makes the orders, moves the recordings, and holds on to cells:
the next one is forked while the student's packages are still being built.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.errors import GraderFault
from grader.machine.ros import RosInstallation
from grader.recording.mcap_writer import write_recording
from grader.run.admission import Admission
from grader.run.cell.cell_process import CellProcess
from grader.run.cell.middleware_hang import MiddlewareHung, hung_recording
from grader.run.cell.prefork_server import PreforkServer
from grader.run.make_order import make_order
from grader.run.request import RunRequest

if TYPE_CHECKING:
    from grader.assignment.model import Scenario
    from grader.sandbox.sandbox import Sandbox

_STARTED_EVENTS = ("matched", "stopping", "recorded")

Progress = Callable[[str, Mapping[str, Any]], None]
"""Called with the scenario's id and what happened."""


@dataclass
class Runner:
    """Runs scenarios in cells.

    Attributes:
        sandbox: What cells and students run in, or None.
        verbose: Tell what the student's processes print, as progress.
        cpu_s: CPU time of all cells so far.
        students_cpu_s: That of the student's processes in them.
    """

    ros: RosInstallation
    admission: Admission = field(default_factory=Admission)
    progress: Progress = lambda _scenario, _event: None
    cpu_s: float = 0.0
    students_cpu_s: float = 0.0
    sandbox: Sandbox | None = None
    verbose: bool = False
    _ready: list[CellProcess] = field(default_factory=list)
    _cells: set[CellProcess] = field(default_factory=set)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _server: PreforkServer | None = None
    _retired: list[PreforkServer] = field(default_factory=list)
    _aborted: bool = False

    def get_ready(self) -> None:
        """Start a cell for the next run, while what is to be run is still being prepared.

        Does nothing where one is ready already.
        """
        with self._lock:
            if not (self._aborted or self._ready):
                self._ready.append(self._new_cell(()))

    def run(self, request: RunRequest, recording: Path, *, alone: bool = False) -> None:
        """Run one scenario and write its recording.

        Raises:
            GraderFault: The cell failed, through no fault of the student's.
        """
        with self.admission.cell(alone=alone) as ticket:
            cell = self._take_cell(request.scenario)
            students_cpu_s = 0.0
            try:
                order = make_order(request, cell, self.ros, self.sandbox)
                order = replace(order, tells_output=self.verbose)
                recording.parent.mkdir(parents=True, exist_ok=True)
                launched_ns = time.time_ns()
                try:
                    for event in cell.run(order):
                        if event["event"] in _STARTED_EVENTS:
                            ticket.started()
                        students_cpu_s = event.get("students_cpu_s", 0.0)
                        self.progress(order.scenario, event)
                except MiddlewareHung:
                    hung = hung_recording(order, request.submission, launched_ns)
                    write_recording(recording, hung, (), {})
                else:
                    shutil.move(cell.recording, recording)
            finally:
                cell.close()
                with self._lock:
                    self._cells.discard(cell)
                    self.cpu_s += cell.cpu_s
                    self.students_cpu_s += students_cpu_s

    def __enter__(self) -> Runner:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End every cell; each kills what it started. Nothing can be run any more."""
        with self._lock:
            self._aborted = True
            ready, self._ready = self._ready, []
            for cell in (*ready, *self._cells):
                cell.abandon()
        for cell in ready:
            cell.close()
        for server in (*self._retired, *filter(None, (self._server,))):
            server.close()

    def successor(self) -> Runner:
        """End every cell, and return a new runner that takes over the warm processes.

        This one can run nothing any more.
        """
        with self._lock:
            self._aborted = True
            server, self._server = self._server, None
        self.close()
        return replace(
            self,
            _ready=[],
            _cells=set(),
            _lock=threading.Lock(),
            _server=server,
            _retired=[],
            _aborted=False,
        )

    def _take_cell(self, scenario: Scenario) -> CellProcess:
        with self._lock:
            if self._aborted:
                raise GraderFault("interrupted")
            cell = self._ready.pop() if self._ready else self._new_cell(_imports_of(scenario))
            self._cells.add(cell)
        return cell

    def _new_cell(self, imports: Sequence[str]) -> CellProcess:
        if self._server is not None and not self._server.is_usable:
            # Its cells may still run and need their folders; to wait for them here would take long.
            self._retired.append(self._server)
            self._server = None
        if self._server is None:
            self._server = PreforkServer(self.ros, self.sandbox)
        return CellProcess(self._server, imports)


def _imports_of(scenario: Scenario) -> list[str]:
    """What a cell of a scenario imports, beyond what every cell does: modules and interfaces."""
    imports = {*scenario.recorded_types.values()}
    if scenario.turtles:
        imports.add("grader.run.cell.turtles")
    elif scenario.world is not None:
        imports.add("grader.run.cell.simulator")
    if scenario.simulator is not None:
        imports.add("grader.run.cell.author_simulator")
    return sorted(imports)
