"""Makes the order for a cell from what the runner is asked for."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from grader.errors import GraderFault
from grader.machine.load import cpu_count
from grader.machine.resources import cache_folder
from grader.machine.ros import RosInstallation
from grader.recording.interface import definition_finder
from grader.recording.model import to_json
from grader.recording.submission import SubmissionRecord
from grader.run.cell.cell_process import SCRATCH, CellProcess
from grader.run.compiled_tracer import compiled_tracer, has_compiled_programs
from grader.run.environment import RMW, companion_environment, student_environment
from grader.run.imposing.mistake import with_mistakes
from grader.run.order import (
    AuthorSimulatorOrder,
    CellOrder,
    ProcessCommand,
    RunLimits,
    SimulatorOrder,
    Topic,
    UntilOrder,
)
from grader.run.programs import companion, process_command
from grader.run.request import RunRequest
from grader.run.sandboxed_order import sandboxed
from grader.sandbox.python_tree import unlisted
from grader.submission.read.rosdistro import PACKAGES
from sim.turtles.interfaces import commands as turtle_commands

if TYPE_CHECKING:
    from grader.assignment.model import Scenario, Until
    from grader.assignment.stimuli.stimulus_model import StimulusModel
    from grader.sandbox.sandbox import Sandbox

_DEPTH = 100
"""Of the probe's subscriptions to what simulators publish and receive, in messages."""


def make_order(
    request: RunRequest, cell: CellProcess, installed: RosInstallation, sandbox: Sandbox | None
) -> CellOrder:
    """Make the order, and put what it needs into the cell's folder.

    Raises:
        GraderFault: The assignment asks for what is not there.
    """
    ros = replace(installed, underlays=request.underlays or installed.underlays)
    (cell.folder / SCRATCH).mkdir()
    order = _plain_order(request, cell.folder / SCRATCH, ros)
    if request.mistakes:
        order = with_mistakes(order, request.mistakes, cell.folder, ros)
    libraries = request.assignment.libraries
    if sandbox is None or ros.source == "sourced":
        # A sandbox shows the system's libraries, which Python finds where ROS is sourced.
        visible = Path("/" if sandbox is None else "/usr")
        modules = unlisted(request.submission.foreign_imports, libraries, visible)
        order.environment["unlisted"] = " ".join(modules)
    if sandbox is None:
        return order
    limits = (request.scenario.limits or request.assignment.limits).limits()
    return sandboxed(order, cell, sandbox.allowing(libraries), ros, request.install, limits)


def _plain_order(request: RunRequest, scratch: Path, ros: RosInstallation) -> CellOrder:
    """The order for a cell without a sandbox."""
    from grader.assignment.random_values import draw_values

    scenario, install, worlds = request.scenario, request.install, request.worlds
    values = draw_values(scenario, request.seed)
    commands = tuple(
        process_command(ros, launch, request.assignment, install, values, request.names)
        for launch in scenario.launch
    )
    simulator = scenario.simulator
    companions = scenario.companions if simulator is None else (simulator, *scenario.companions)
    hidden = set() if simulator is None else {str(simulator.package)}
    compiled = has_compiled_programs(install)
    tracer = compiled_tracer(ros, cache_folder()) if compiled else None
    ros_paths, own = (*ros.underlays, *ros.prefixes), request.type_support
    # rosgrade's own definition comes before one of the student's.
    definitions = tuple(map(str, (*own, *ros_paths, install)))
    return CellOrder(
        scenario=scenario.id,
        seed=request.seed,
        commands=commands,
        companions=tuple(companion(ros, launch, values) for launch in companions),
        student_environment=student_environment(ros, (install,), scratch, tracer),
        companion_environment=companion_environment(ros, scratch),
        compiled_tracer=str(tracer) if tracer else None,
        prefixes=tuple(map(str, (*own, install, *ros_paths))),
        topics=_topics(scenario),
        stimuli=_stimuli(scenario, commands, worlds, definitions, request.seed, values),
        until=_until(scenario.until),
        limits=RunLimits(scenario.discovery, scenario.timeout, scenario.shutdown),
        scratch=str(scratch),
        submission=to_json(request.submission).decode(),
        simulator=_simulator(scenario, worlds, values, request.seed),
        author_simulator=_author_simulator(scenario, worlds, values),
        hidden=frozenset(hidden - PACKAGES),
        values=values,
        environment={
            "assignment": request.assignment.id,
            "ros_distro": ros.distro,
            "ros_source": ros.source,
            "rmw": RMW,
            "python": ".".join(map(str, sys.version_info[:3])),
            "sandbox": "none",
            "ros_imports": " ".join(_ros_imports(request.submission, ros)),
            # As many threads as rclpy's MultiThreadedExecutor takes by itself.
            "cpus": str(cpu_count()),
            "compiled_tracer": "preloaded" if tracer else "lacking" if compiled else "none",
            "parameters": " ".join(_launch_parameters(scenario)),
        },
        names=request.names,
        type_support=tuple(map(str, own)),
        pauses=request.pauses,
    )


def _ros_imports(submission: SubmissionRecord, ros: RosInstallation) -> list[str]:
    """Modules of ROS that a submission imports and this installation has."""
    imported = {item.module for package in submission.packages for item in package.ros_imports}
    return sorted(imported & set(ros.packages))


def _topics(scenario: Scenario) -> tuple[Topic, ...]:
    """What is recorded: the author's topics, and those of the simulated robot or turtles."""
    types = scenario.recorded_types
    topics = {
        asked.topic: Topic(
            asked.topic, asked.type, asked.reliability, asked.durability, asked.depth
        )
        for asked in scenario.record
    }
    robots = scenario.simulated_robots.values()
    commands = {robot.topics.command.topic: robot.topics.command.type for robot in robots}
    for name, type in {**turtle_commands(scenario.turtles), **commands}.items():
        topics.setdefault(name, Topic(name, type, "reliable", "volatile", _DEPTH))
    for robot in robots:
        for sensor in (robot.topics.odometry, robot.topics.scan, *robot.sensors):
            name, qos = sensor.topic, (sensor.reliability, sensor.durability)
            if name in types:
                topics[name] = Topic(name, types[name], *qos, _DEPTH, ours=True)
    for name in scenario.camera_topics & topics.keys():
        topics[name] = replace(topics[name], ours=True)
    for name, durability in scenario.transform_topics.items():
        qos = (scenario.topics.tf.reliability, durability)
        topics.setdefault(name, Topic(name, types[name], *qos, _DEPTH, ours=True))
    return tuple(topics.values())


def _until(until: Until) -> UntilOrder:
    return UntilOrder(
        messages=until.messages,
        quiet_s=until.quiet,
        elapsed_s=until.elapsed,
        at_rest_s=until.at_rest,
        travelled_m=until.travelled,
        stimuli_done=until.stimuli is not None,
        any=tuple(map(_until, until.any)),
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

    simulator = scenario.simulator
    if simulator is None:
        return None
    return AuthorSimulatorOrder(
        name=f"{simulator.package}/{simulator.program}",
        options=simulator,
        map=str((worlds / simulator.map).resolve()) if simulator.map else None,
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
    from grader.assignment.stimuli.stimulus_model import Preparation

    find = definition_finder(Path(prefix) for prefix in prefixes)
    preparation = Preparation(folder, find, seed, drawn, [command.name for command in commands])
    stimuli: list[StimulusModel] = []
    for stimulus in scenario.stimuli:
        what = f"the stimulus {stimulus.key!r}"
        if stimulus.exchanged:
            what += f" on {stimulus.exchanged[0]}"
        try:
            stimuli.append(stimulus.prepared(preparation))
        except StimulusError as error:
            raise GraderFault(f"{what}: {error}") from error
        except KeyError as error:
            raise GraderFault(f"{what}: no definition of {error.args[0]} was found") from error
    if parameters := _launch_parameters(scenario):
        stimuli.append(AskDeclared(names=tuple(parameters)))
    return tuple(stimuli)


def _launch_parameters(scenario: Scenario) -> list[str]:
    """Names of the parameters that the programs of a scenario are launched with."""
    return list(dict.fromkeys(name for launch in scenario.launch for name in launch.parameters))
