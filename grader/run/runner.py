"""From a scenario and a built submission to a recording: orders a cell and waits for it."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.errors import GraderFault
from grader.machine.load import cpu_count
from grader.machine.resources import cache_folder
from grader.machine.ros import RosInstallation
from grader.recording.interface import definition_finder
from grader.recording.mcap_writer import write_recording
from grader.recording.model import to_json
from grader.recording.submission import SubmissionRecord
from grader.run.admission import Admission
from grader.run.cell.cell_process import SCRATCH, CellProcess
from grader.run.cell.middleware_hang import MiddlewareHung, hung_recording
from grader.run.cell.prefork_server import (
    AUTHOR_SIMULATOR_MODULE,
    SIMULATOR_MODULE,
    TURTLES_MODULE,
    PreforkServer,
)
from grader.run.compiled_tracer import compiled_tracer, has_compiled_programs
from grader.run.environment import RMW, companion_environment, student_environment
from grader.run.imposing.mistake import Mistake, with_mistakes
from grader.run.order import (
    AuthorSimulatorOrder,
    CellOrder,
    ProcessCommand,
    RunLimits,
    SimulatorOrder,
    Topic,
    UntilOrder,
)
from grader.run.sandboxed_order import sandboxed
from grader.sandbox.python_tree import unlisted
from grader.spec.name import FIND_SHARE
from grader.spec.names import NO_NAMES, Names, Thing
from grader.submission.read.rosdistro import PACKAGES
from sim.turtles.interfaces import commands

if TYPE_CHECKING:
    from grader.assignment.model import Assignment, Launch, Scenario, Until
    from grader.assignment.stimuli.stimulus_model import StimulusModel
    from grader.sandbox.sandbox import Sandbox

_STARTED_EVENTS = ("matched", "stopping", "recorded")

Progress = Callable[[str, Mapping[str, Any]], None]
"""Called with the scenario's id and what happened."""


def scenario_seed(assignment: str, scenario: str, submission_sha256: str, base: int | None) -> int:
    """Seed of a scenario, in [0, 2**63), from the submission's hash, so that none can be guessed.

    Args:
        base: A seed that the caller gave; replaces the submission.
    """
    origin = submission_sha256 if base is None else str(base)
    digest = hashlib.sha256(f"{assignment}/{scenario}/{origin}".encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def ros_arguments(
    launch: Launch,
    values: dict[str, float],
    names: Names = NO_NAMES,
) -> tuple[str, ...]:
    """Command line arguments of a launch, as ``ros2 run`` passes them on, with names put right."""
    from grader.assignment.random_values import fill_in

    rules: list[str] = []
    if launch.name:
        rules += ["-r", f"__node:={launch.name}"]
    if launch.namespace:
        rules += ["-r", f"__ns:={launch.namespace}"]
    written = (f"{old}:={new}" for old, new in launch.remap.items())
    for rule in (*written, *names.rules):
        rules += ["-r", rule]
    for name, value in launch.parameters.items():
        # The value is YAML to rcl, and JSON is YAML.
        text = json.dumps(fill_in(value, values))
        for one in dict.fromkeys((name, names.own(Thing.PARAMETER, name))):
            rules += ["-p", f"{one}:={text}"]
    ros_args = ("--ros-args", *rules) if rules else ()
    return (*launch.arguments, *ros_args)


def launch_file_program(ros: RosInstallation, package: str, file: str) -> tuple[str, ...]:
    """What starts a launch file, as `ros2 launch` does."""
    for prefix in (*ros.underlays, *ros.prefixes):
        ros2 = prefix / "bin" / "ros2"
        if ros2.is_file() and "ros2launch" in ros.packages:
            return (str(ros.python), str(ros2), "launch", package, file)
    raise GraderFault(
        f"{package}/{file} is a launch file, and this ROS ({ros.source}) has no `ros2 launch`: "
        "write `underlays: [launch]` into assignment.yaml, and get it with `rosgrade underlay add "
        "launch`"
    )


def with_shares(arguments: Sequence[str], prefixes: Sequence[Path]) -> tuple[str, ...]:
    """Arguments with the folders of packages in place of ``$(find-pkg-share PACKAGE)``.

    Raises:
        GraderFault: No install space has such a package.
    """

    def share(found: re.Match[str]) -> str:
        for prefix in prefixes:
            if (folder := prefix / "share" / found[1]).is_dir():
                return str(folder)
        raise GraderFault(f"{found[0]}: there is no package {found[1]!r}")

    return tuple(FIND_SHARE.sub(share, one) for one in arguments)


def process_command(
    ros: RosInstallation,
    launch: Launch,
    assignment: Assignment,
    install: Path,
    values: dict[str, float],
    names: Names = NO_NAMES,
) -> ProcessCommand:
    """What to execute for a launch, with names put right."""
    prefixes = (install, *ros.underlays, *ros.prefixes)
    asked = launch.package or assignment.packages[0].name
    package = names.own(Thing.PACKAGE, asked)
    if launch.executable is None:
        file = names.own_file(f"share/{asked}", launch.program)
        program = launch_file_program(ros, package, file)
        # It says itself how its nodes and their topics are called.
        names = NO_NAMES
    else:
        place, right = (f"lib/{one}/{launch.executable}" for one in (package, asked))
        # The setup.cfg of a package with a wrong name may say the right one.
        place = right if (install / right).is_file() else place
        program = _program(ros, install / names.own(Thing.FILE, place))
    return ProcessCommand(
        name=f"{asked}/{launch.program}",
        argv=(*program, *with_shares(ros_arguments(launch, values, names), prefixes)),
        after_s=launch.after,
        is_launch_file=launch.file is not None,
    )


def companion(ros: RosInstallation, launch: Launch, values: dict[str, float]) -> ProcessCommand:
    """What to execute of the author's.

    Raises:
        GraderFault: No install space has such an executable or launch file.
    """
    prefixes = (*ros.underlays, *ros.prefixes)
    package, is_file = str(launch.package), launch.file is not None
    name, folder = f"{package}/{launch.program}", f"share/{package}" if is_file else "lib"
    arguments = with_shares(ros_arguments(launch, values), prefixes)
    for prefix in prefixes:
        if not is_file and (file := prefix / folder / name).is_file():
            return ProcessCommand(name, (*_program(ros, file), *arguments))
        # `ros2 launch` finds it in any folder there.
        if is_file and any((prefix / folder).rglob(launch.program)):
            program = launch_file_program(ros, package, launch.program)
            return ProcessCommand(name, (*program, *arguments), is_launch_file=True)
    what = "launch file" if is_file else "executable"
    raise GraderFault(
        f"the program {name} of the assignment is not there: its package installs no such {what}"
    )


def _program(ros: RosInstallation, file: Path) -> tuple[str, ...]:
    """What `ros2 run` would execute.

    A Python script is given to the interpreter by name, because its first line cannot hold a path
    with a space in it.
    """
    try:
        with file.open("rb") as stream:
            first = stream.readline(256)
    except OSError:
        first = b""
    is_python = first.startswith(b"#!") and b"python" in first
    return (str(ros.python), str(file)) if is_python else (str(file),)


def _topics(scenario: Scenario) -> tuple[Topic, ...]:
    """What is recorded: the author's topics, and those of the simulated robot or turtles."""
    found = {
        one.topic: Topic(one.topic, one.type, one.reliability, one.durability, one.depth)
        for one in scenario.record
    }
    for name, type in commands(scenario.turtles).items():
        found.setdefault(name, Topic(name, type, "reliable", "volatile", 100))
    for robot in scenario.simulated.values():
        command = robot.topics.command
        own = Topic(command.topic, command.type, "reliable", "volatile", 100)
        found.setdefault(command.topic, own)
        for options in (robot.topics.odometry, robot.topics.scan, *robot.sensors):
            name = options.topic
            if name in scenario.recorded_types:
                type = scenario.recorded_types[name]
                qos = (options.reliability, options.durability, 100)
                found[name] = Topic(name, type, *qos, ours=True)
    for name in scenario.camera_topics & found.keys():
        found[name] = replace(found[name], ours=True)
    for name, durability in scenario.transform_topics.items():
        qos = (scenario.topics.tf.reliability, durability, 100)
        found.setdefault(name, Topic(name, scenario.recorded_types[name], *qos, ours=True))
    return tuple(found.values())


def _until(until: Until) -> UntilOrder:
    return UntilOrder(
        messages=until.messages,
        quiet_s=until.quiet,
        elapsed_s=until.elapsed,
        at_rest_s=until.at_rest,
        travelled_m=until.travelled,
        stimuli_done=until.stimuli is not None,
        any=tuple(_until(item) for item in until.any),
    )


def _simulator(
    scenario: Scenario, worlds: Path, values: dict[str, float], seed: int
) -> SimulatorOrder | None:
    from grader.assignment.random_values import world_values

    if scenario.world is None:
        return None
    return SimulatorOrder(
        world=str((worlds / scenario.world).resolve()),
        values=world_values(scenario, values),
        options=scenario.simulation.model_dump_json(),
        robots={name: one.model_dump_json() for name, one in scenario.robots.items()},
        seed=seed,
        has_turtles=bool(scenario.turtles),
    )


def _author_simulator(
    scenario: Scenario, worlds: Path, values: dict[str, float]
) -> AuthorSimulatorOrder | None:
    from grader.assignment.random_values import world_values

    own = scenario.simulator
    if own is None:
        return None
    return AuthorSimulatorOrder(
        name=f"{own.package}/{own.program}",
        options=own,
        map=str((worlds / own.map).resolve()) if own.map else None,
        values=world_values(scenario, values),
    )


def _stimuli(
    scenario: Scenario,
    commands: Sequence[ProcessCommand],
    folder: Path,
    prefixes: Sequence[str],
    seed: int,
    drawn: Mapping[str, float],
) -> tuple[StimulusModel, ...]:
    from grader.assignment.stimuli.kinds.request import AskDeclared
    from grader.assignment.stimuli.message import StimulusError
    from grader.assignment.stimuli.stimulus_model import Making

    find = definition_finder(Path(prefix) for prefix in prefixes)
    making = Making(folder, find, seed, drawn, [command.name for command in commands])
    found: list[StimulusModel] = []
    for item in scenario.stimuli:
        what = f"the stimulus {item.key!r}" + (f" on {item.exchanged[0]}" if item.exchanged else "")
        try:
            found.append(item.prepared(making))
        except StimulusError as error:
            raise GraderFault(f"{what}: {error}") from error
        except KeyError as error:
            raise GraderFault(f"{what}: no definition of {error.args[0]} was found") from error
    if given := given_parameters(scenario):
        found.append(AskDeclared(names=tuple(given)))
    return tuple(found)


def given_parameters(scenario: Scenario) -> list[str]:
    """Names of the parameters that the programs of a scenario are launched with."""
    return list(dict.fromkeys(name for one in scenario.launch for name in one.parameters))


@dataclass(frozen=True)
class RunRequest:
    """One scenario to run with a submission that is built.

    Attributes:
        install: The submission's install space (merged layout).
        worlds: Folder that world files are relative to.
        underlays: Of the submission; by default those of the runner's ROS.
        names: Wrong names to put right.
        pauses: Whether the executors pause after the observation.
        mistakes: What is imposed on its programs; of selftest only.
    """

    assignment: Assignment
    scenario: Scenario
    submission: SubmissionRecord
    install: Path
    seed: int
    worlds: Path = Path()
    underlays: tuple[Path, ...] = ()
    type_support: tuple[Path, ...] = ()
    names: Names = NO_NAMES
    pauses: bool = False
    mistakes: tuple[Mistake, ...] = ()


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
                order = self._order(request, cell)
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
        imports = {*scenario.recorded_types.values()}
        if scenario.world is not None:
            imports.add(TURTLES_MODULE if scenario.turtles else SIMULATOR_MODULE)
        if scenario.simulator is not None:
            imports.add(AUTHOR_SIMULATOR_MODULE)
        with self._lock:
            if self._aborted:
                raise GraderFault("interrupted")
            cell = self._ready.pop() if self._ready else self._new_cell(sorted(imports))
            self._cells.add(cell)
        return cell

    def _new_cell(self, imports: Sequence[str]) -> CellProcess:
        if self._server is not None and not self._server.is_alive:
            # Its cells may still run and need their folders; to wait for them here would take long.
            self._retired.append(self._server)
            self._server = None
        if self._server is None:
            self._server = PreforkServer(self.ros, self.sandbox)
        return CellProcess(self._server, imports)

    def _order(self, request: RunRequest, cell: CellProcess) -> CellOrder:
        from grader.assignment.random_values import draw_values

        assignment, scenario, submission = request.assignment, request.scenario, request.submission
        ros = replace(self.ros, underlays=request.underlays or self.ros.underlays)
        install, type_support, seed = request.install, request.type_support, request.seed
        scratch = cell.folder / SCRATCH
        scratch.mkdir()
        values = draw_values(scenario, seed)
        commands = tuple(
            process_command(ros, launch, assignment, install, values, request.names)
            for launch in scenario.launch
        )
        own = (*filter(None, (scenario.simulator,)), *scenario.companions)
        companions = tuple(companion(ros, one, values) for one in own)
        compiled = has_compiled_programs(install)
        tracer = compiled_tracer(ros, cache_folder()) if compiled else None
        imported = {item.module for package in submission.packages for item in package.ros_imports}
        # rosgrade's own definition comes before one of the student's.
        definitions = tuple(map(str, (*type_support, *ros.underlays, *ros.prefixes, install)))
        order = CellOrder(
            scenario=scenario.id,
            seed=seed,
            commands=commands,
            companions=companions,
            student_environment=student_environment(ros, (install,), scratch, tracer),
            companion_environment=companion_environment(ros, scratch),
            compiled_tracer=str(tracer) if tracer else None,
            prefixes=tuple(map(str, (*type_support, install, *ros.underlays, *ros.prefixes))),
            topics=_topics(scenario),
            stimuli=_stimuli(scenario, commands, request.worlds, definitions, seed, values),
            until=_until(scenario.until),
            limits=RunLimits(scenario.discovery, scenario.timeout, scenario.shutdown),
            scratch=str(scratch),
            submission=to_json(submission).decode(),
            simulator=_simulator(scenario, request.worlds, values, seed),
            author_simulator=_author_simulator(scenario, request.worlds, values),
            hidden=frozenset({scenario.simulator.package} if scenario.simulator else ()) - PACKAGES,
            values=values,
            environment={
                "assignment": assignment.id,
                "ros_distro": self.ros.distro,
                "ros_source": self.ros.source,
                "rmw": RMW,
                "python": ".".join(map(str, sys.version_info[:3])),
                "sandbox": "none",
                "ros_imports": " ".join(sorted(imported & set(ros.packages))),
                # As many threads as rclpy's MultiThreadedExecutor takes by itself.
                "cpus": str(cpu_count()),
                "compiled_tracer": "preloaded" if tracer else "lacking" if compiled else "none",
                "parameters": " ".join(given_parameters(scenario)),
            },
            names=request.names,
            type_support=tuple(map(str, type_support)),
            tells_output=self.verbose,
            pauses=request.pauses,
        )
        if request.mistakes:
            order = with_mistakes(order, request.mistakes, cell.folder, ros)
        if self.sandbox is None or ros.source == "sourced":
            # A sandbox shows the system's libraries, which Python finds where ROS is sourced.
            shown = Path("/" if self.sandbox is None else "/usr")
            modules = unlisted(submission.foreign_imports, assignment.libraries, shown)
            order.environment["unlisted"] = " ".join(modules)
        if self.sandbox is None:
            return order
        limits = (scenario.limits or assignment.limits).limits()
        sandbox = self.sandbox.allowing(assignment.libraries)
        return sandboxed(order, cell, sandbox, ros, install, limits)
