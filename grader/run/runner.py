"""From a scenario and a built submission to a recording: orders a cell and waits for it."""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.errors import GraderFault
from grader.recording.fact import to_json
from grader.ros import RosInstallation
from grader.run.admission import Admission
from grader.run.cell_process import SCRATCH, CellProcess
from grader.run.environment import RMW, student_environment
from grader.run.order import CellOrder, Command, Limits, SimulatorOrder, Topic, Until
from grader.submission.record import SubmissionRecord

if TYPE_CHECKING:
    from grader.assignment.model import Assignment, Launch, Scenario
    from grader.assignment.model import Until as UntilModel

_STARTED_EVENTS = ("matched", "stopping", "recorded")

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


def ros_arguments(launch: Launch, values: dict[str, float]) -> tuple[str, ...]:
    """Command line arguments of a launch, as ``ros2 run`` passes them on.

    Args:
        launch: What is launched.
        values: Random values of the scenario, for parameters.
    """
    from grader.assignment.drawing import fill_in

    rules: list[str] = []
    if launch.name:
        rules += ["-r", f"__node:={launch.name}"]
    if launch.namespace:
        rules += ["-r", f"__ns:={launch.namespace}"]
    for old, new in launch.remap.items():
        rules += ["-r", f"{old}:={new}"]
    for name, value in launch.parameters.items():
        # The value is YAML to rcl, and JSON is YAML.
        rules += ["-p", f"{name}:={json.dumps(fill_in(value, values))}"]
    ros_args = ("--ros-args", *rules) if rules else ()
    return (*launch.arguments, *ros_args)


def _topics(scenario: Scenario) -> tuple[Topic, ...]:
    """What is recorded: the author's topics, and those of the simulated robot."""
    found = {
        topic.topic: Topic(
            topic.topic, topic.type, topic.reliability, topic.durability, topic.depth
        )
        for topic in scenario.record
    }
    if scenario.world is not None:
        command = scenario.topics.command
        found.setdefault(
            command.topic, Topic(command.topic, command.type, "reliable", "volatile", 100)
        )
        for options in (scenario.topics.odometry, scenario.topics.scan):
            if options.topic in scenario.recorded_types:
                found[options.topic] = Topic(
                    options.topic,
                    scenario.recorded_types[options.topic],
                    options.reliability,
                    options.durability,
                    100,
                    ours=True,
                )
    return tuple(found.values())


def _until(until: UntilModel) -> Until:
    return Until(
        messages=until.messages,
        quiet_s=until.quiet,
        elapsed_s=until.elapsed,
        at_rest_s=until.at_rest,
        travelled_m=until.travelled,
        any=tuple(_until(item) for item in until.any),
    )


def _simulator(
    scenario: Scenario, worlds: Path, values: dict[str, float], seed: int
) -> SimulatorOrder | None:
    from grader.assignment.drawing import world_values
    from sim.description import SimulatorOptions

    if scenario.world is None:
        return None
    options = SimulatorOptions(
        robot=scenario.robot,
        lidar=scenario.lidar,
        odometry=scenario.odometry,
        topics=scenario.topics,
    )
    return SimulatorOrder(
        world=str((worlds / scenario.world).resolve()),
        values=world_values(scenario, values),
        options=options.model_dump_json(),
        seed=seed,
    )


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
    _ready: list[CellProcess] = field(default_factory=list)
    _cells: set[CellProcess] = field(default_factory=set)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _aborted: bool = False

    def get_ready(self) -> None:
        """Start a cell for the next run, while what is to be run is still being prepared."""
        with self._lock:
            if not self._aborted:
                self._ready.append(CellProcess(self.ros))

    def run(
        self,
        assignment: Assignment,
        scenario: Scenario,
        submission: SubmissionRecord,
        install: Path,
        recording: Path,
        *,
        seed: int,
        worlds: Path = Path(),
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
            worlds: Folder that world files are relative to.
            alone: Let no other cell of ours run meanwhile.

        Raises:
            GraderFault: The cell failed, through no fault of the student's.
        """
        with self.admission.cell(alone=alone) as ticket:
            cell = self._take_cell()
            try:
                order = self._order(
                    assignment, scenario, submission, install, cell.folder, seed, worlds
                )
                for event in cell.run(order):
                    if event["event"] in _STARTED_EVENTS:
                        ticket.started()
                    self.progress(scenario.id, event)
                recording.parent.mkdir(parents=True, exist_ok=True)
                shutil.move(cell.recording, recording)
            finally:
                self._give_back(cell)

    def abort(self) -> None:
        """End every cell; each kills what it started. Nothing can be run any more."""
        with self._lock:
            self._aborted = True
            ready, self._ready = self._ready, []
            for cell in (*ready, *self._cells):
                cell.abandon()
        for cell in ready:
            cell.close()

    def _take_cell(self) -> CellProcess:
        with self._lock:
            if self._aborted:
                raise GraderFault("interrupted")
            cell = self._ready.pop() if self._ready else CellProcess(self.ros)
            self._cells.add(cell)
        return cell

    def _give_back(self, cell: CellProcess) -> None:
        cell.close()
        with self._lock:
            self._cells.discard(cell)

    def _order(
        self,
        assignment: Assignment,
        scenario: Scenario,
        submission: SubmissionRecord,
        install: Path,
        folder: Path,
        seed: int,
        worlds: Path,
    ) -> CellOrder:
        from grader.assignment.drawing import draw_values

        scratch = folder / SCRATCH
        scratch.mkdir()
        values = draw_values(scenario, seed)
        every = [stimulus.every for stimulus in scenario.stimuli]
        return CellOrder(
            scenario=scenario.id,
            seed=seed,
            commands=tuple(
                self._command(launch, assignment.packages[0].name, install, values)
                for launch in scenario.launch
            ),
            environment=student_environment(self.ros, install, scratch),
            prefixes=tuple(str(prefix) for prefix in (install, *self.ros.prefixes)),
            topics=_topics(scenario),
            list_parameters_s=min(every) if every else None,
            until=_until(scenario.until),
            limits=Limits(
                discovery_s=scenario.discovery,
                timeout_s=scenario.timeout,
                shutdown_s=scenario.shutdown,
            ),
            scratch=str(scratch),
            submission=to_json(submission).decode(),
            simulator=_simulator(scenario, worlds, values, seed),
            values=values,
            facts={
                "assignment": assignment.id,
                "ros_distro": self.ros.distro,
                "ros_source": self.ros.source,
                "rmw": RMW,
                "python": ".".join(map(str, sys.version_info[:3])),
                "sandbox": "none",
            },
        )

    def _command(
        self, launch: Launch, default_package: str, install: Path, values: dict[str, float]
    ) -> Command:
        package = launch.package or default_package
        program = self._program(install / "lib" / package, launch.executable)
        return Command(
            name=f"{package}/{launch.executable}", argv=(*program, *ros_arguments(launch, values))
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
