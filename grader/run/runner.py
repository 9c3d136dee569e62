"""From a scenario and a built submission to a recording: orders a cell and waits for it."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from grader.assignment.model import Assignment, Launch, Scenario
from grader.errors import GraderFault
from grader.recording.mcap_writer import to_json
from grader.ros import RosInstallation
from grader.run.admission import Admission
from grader.run.descendants import kill_tree
from grader.run.environment import RMW, cell_environment, student_environment
from grader.run.order import (
    ORDER_FILE,
    RECORDING_FILE,
    CellOrder,
    Command,
    Limits,
    Topic,
    Until,
)
from grader.submission.record import SubmissionRecord

_STARTED_EVENTS = ("matched", "stopping", "recorded")
_ENDING_LIMIT_S = 10.0
# Beyond every bounded wait of a cell, even stretched by a busy host: something of ours hangs.
_HANGING_CELL_S = 600.0

Progress = Callable[[str, Mapping[str, Any]], None]
"""Called with the scenario's id and what happened."""


def scenario_seed(assignment: str, scenario: str, submission_sha256: str, base: int | None) -> int:
    """Seed of a scenario: of the submission's own, so that nobody can write for known numbers.

    Args:
        assignment: Its id.
        scenario: Its id.
        submission_sha256: Of the submission.
        base: A seed that the caller gave; replaces the submission.

    Returns:
        A number in [0, 2**63).
    """
    origin = submission_sha256 if base is None else str(base)
    digest = hashlib.sha256(f"{assignment}/{scenario}/{origin}".encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def ros_arguments(launch: Launch) -> tuple[str, ...]:
    """Command line arguments of a launch, as ``ros2 run`` passes them on."""
    rules: list[str] = []
    if launch.name:
        rules += ["-r", f"__node:={launch.name}"]
    if launch.namespace:
        rules += ["-r", f"__ns:={launch.namespace}"]
    for old, new in launch.remap.items():
        rules += ["-r", f"{old}:={new}"]
    for name, value in launch.parameters.items():
        # The value is YAML to rcl, and JSON is YAML.
        rules += ["-p", f"{name}:={json.dumps(value)}"]
    ros_args = ("--ros-args", *rules) if rules else ()
    return (*launch.arguments, *ros_args)


@dataclass
class Runner:
    """Runs scenarios in cells.

    Attributes:
        ros: What builds and runs students' packages.
        admission: Shared bounds on cells.
        progress: Told what happens in each scenario.
    """

    ros: RosInstallation
    admission: Admission = field(default_factory=Admission)
    progress: Progress = lambda _scenario, _event: None
    _cells: set[subprocess.Popen[str]] = field(default_factory=set)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _aborted: bool = False

    def run(
        self,
        assignment: Assignment,
        scenario: Scenario,
        submission: SubmissionRecord,
        install: Path,
        recording: Path,
        *,
        seed: int,
        alone: bool = False,
    ) -> None:
        """Run one scenario and leave its recording.

        Args:
            assignment: The scenario's assignment.
            scenario: What to run.
            submission: Facts that go into the recording.
            install: The submission's install space (merged layout).
            recording: File to write.
            seed: For everything random.
            alone: Let no other cell of ours run meanwhile.

        Raises:
            GraderFault: The cell failed, through no fault of the student's.
        """
        with tempfile.TemporaryDirectory(prefix="rosgrade-cell-") as name:
            folder = Path(name)
            order = self._order(assignment, scenario, submission, install, folder, seed)
            (folder / ORDER_FILE).write_text(order.to_json(), encoding="utf-8")
            with self.admission.cell(alone=alone) as ticket:
                self._run_cell(scenario.id, folder, ticket.started)
            recording.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(folder / RECORDING_FILE, recording)

    def abort(self) -> None:
        """End every running cell; each kills what it started."""
        with self._lock:
            self._aborted = True
            cells = list(self._cells)
        for cell in cells:
            if cell.stdin:
                cell.stdin.close()

    def _order(
        self,
        assignment: Assignment,
        scenario: Scenario,
        submission: SubmissionRecord,
        install: Path,
        folder: Path,
        seed: int,
    ) -> CellOrder:
        scratch = folder / "scratch"
        scratch.mkdir()
        default_package = assignment.packages[0].name
        every = [stimulus.every for stimulus in scenario.stimuli]
        until = scenario.until
        avoid = os.environ.get("ROS_DOMAIN_ID", "")
        return CellOrder(
            scenario=scenario.id,
            seed=seed,
            commands=tuple(
                Command(
                    name=f"{launch.package or default_package}/{launch.executable}",
                    argv=(
                        *self._program(
                            install / "lib" / (launch.package or default_package), launch.executable
                        ),
                        *ros_arguments(launch),
                    ),
                )
                for launch in scenario.launch
            ),
            environment=student_environment(self.ros, install, scratch),
            prefixes=tuple(str(prefix) for prefix in (install, *self.ros.prefixes)),
            topics=tuple(
                Topic(t.topic, t.type, t.reliability, t.durability, t.depth)
                for t in scenario.record
            ),
            list_parameters_s=min(every) if every else None,
            until=Until(until.messages, until.quiet, until.elapsed),
            limits=Limits(
                discovery_s=scenario.discovery,
                timeout_s=scenario.timeout,
                shutdown_s=scenario.shutdown,
            ),
            scratch=str(scratch),
            submission=to_json(submission).decode(),
            facts={
                "assignment": assignment.id,
                "ros_distro": self.ros.distro,
                "ros_source": self.ros.source,
                "rmw": RMW,
                "python": ".".join(map(str, sys.version_info[:3])),
                "sandbox": "none",
            },
            avoid_domains=(int(avoid),) if avoid.isdigit() else (),
        )

    def _program(self, folder: Path, executable: str) -> tuple[str, ...]:
        """What `ros2 run` would execute.

        A Python script is given to the interpreter by name, because its first line cannot
        hold a path with a space in it.
        """
        file = folder / executable
        try:
            with file.open("rb") as stream:
                first = stream.readline(256)
        except OSError:
            first = b""
        is_python = first.startswith(b"#!") and b"python" in first
        return (str(self.ros.python), str(file)) if is_python else (str(file),)

    def _run_cell(self, scenario: str, folder: Path, started: Callable[[], None]) -> None:
        errors = (folder / "stderr.txt").open("w+", encoding="utf-8", errors="replace")
        with errors:
            cell = self._start_cell(folder, errors)
            watchdog = threading.Timer(_HANGING_CELL_S, kill_tree, (cell.pid,))
            watchdog.start()
            try:
                self._follow(scenario, cell, started)
            finally:
                watchdog.cancel()
                self._end_cell(cell)
            if cell.returncode == 0 and (folder / RECORDING_FILE).exists():
                return
            if self._aborted:
                raise GraderFault("interrupted")
            errors.seek(0)
            raise GraderFault(
                f"the cell of scenario {scenario!r} ended with status {cell.returncode}:\n"
                + errors.read()[-4000:].strip()
            )

    def _start_cell(self, folder: Path, errors: Any) -> subprocess.Popen[str]:
        with self._lock:
            if self._aborted:
                raise GraderFault("interrupted")
            cell = subprocess.Popen(
                [str(self.ros.python), "-m", "grader.run.cell", str(folder)],
                env=cell_environment(self.ros),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                start_new_session=True,
            )
            self._cells.add(cell)
        return cell

    def _follow(
        self, scenario: str, cell: subprocess.Popen[str], started: Callable[[], None]
    ) -> None:
        assert cell.stdout is not None
        for line in cell.stdout:
            event = json.loads(line)
            if event["event"] in _STARTED_EVENTS:
                started()
            self.progress(scenario, event)

    def _end_cell(self, cell: subprocess.Popen[str]) -> None:
        """Wait for a cell that has said its last word; make an end of one that hangs."""
        assert cell.stdin is not None and cell.stdout is not None
        cell.stdin.close()
        try:
            cell.wait(_ENDING_LIMIT_S)
        except subprocess.TimeoutExpired:
            kill_tree(cell.pid)
            cell.wait()
        cell.stdout.close()
        with self._lock:
            self._cells.discard(cell)
