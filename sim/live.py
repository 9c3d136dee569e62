"""The simulator alone, for a student to drive against, with a live view in the terminal."""

from __future__ import annotations

import signal
import sys
import time
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, TextIO

import rclpy
from pydantic import TypeAdapter, ValidationError
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from grader.errors import UsageError
from grader.spec.nearest_name import did_you_mean
from sim.coordinates import PoseInPlane
from sim.description import SimulatorOptions, read_options
from sim.motion import NS, Pose
from sim.node import RosSimulator, make_node
from sim.robot import MODELS
from sim.screen import Screen
from sim.simulation import make_simulation
from sim.world import Values, read_world


def run(
    world_file: Path,
    *,
    options_file: Path | None = None,
    robot: str | None = None,
    pose: str | None = None,
    seed: int = 0,
    domain_id: int | None = None,
    values: Values | None = None,
    duration_s: float | None = None,
    output: TextIO | None = None,
) -> None:
    """Simulate in real time until Ctrl-C.

    Args:
        options_file: Robot, sensors and topics; if left out, the defaults.
        domain_id: ROS domain; if left out, ROS_DOMAIN_ID.
        duration_s: End after so much simulated time, or None.
        output: Where to write; if it is no terminal, one line in a second.

    Raises:
        UsageError: A file cannot be read, or there is no such robot or pose.
        AssignmentError: A file says something that it must not.
    """
    world = read_world(world_file, values)
    options = _options(options_file, robot, pose)
    simulation = make_simulation(world, options, seed)
    context = Context()
    # Ctrl-C is ours: rclpy's handler would shut the context down within a step.
    rclpy.init(
        args=[],
        context=context,
        domain_id=domain_id,
        signal_handler_options=SignalHandlerOptions.NO,
    )
    try:
        node: Any = make_node("rosgrade_sim", context)
        screen = Screen(world, simulation, options)
        simulator = RosSimulator(node, simulation, options, screen)
        screen.simulator = simulator
        with _Interrupts() as interrupts:
            _loop(simulator, screen, interrupts, duration_s, output or sys.stdout)
        node.destroy_node()
    finally:
        context.try_shutdown()


def _loop(
    simulator: RosSimulator,
    screen: Screen,
    interrupts: _Interrupts,
    duration_s: float | None,
    output: TextIO,
) -> None:
    end_ns = None if duration_s is None else round(duration_s * NS)
    with screen.shown(output) as show:
        deadline_ns = simulator.start()
        while not interrupts.came and (end_ns is None or screen.time_ns < end_ns):
            time.sleep(max(0.0, (deadline_ns - time.monotonic_ns()) / NS))
            deadline_ns = simulator.catch_up()
            if deadline_ns > time.monotonic_ns():  # never draw while steps wait
                show()


class _Interrupts:
    """Notices SIGINT and SIGTERM while its block runs.

    A plain flag: a handler that sets a threading.Event may run while its own thread holds the
    lock of that event.
    """

    def __init__(self) -> None:
        self.came = False
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> _Interrupts:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._before[number] = signal.signal(number, self._notice)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _notice(self, number: int, frame: FrameType | None) -> None:
        self.came = True


def _options(file: Path | None, robot: str | None, pose: str | None) -> SimulatorOptions:
    options = read_options(file) if file else SimulatorOptions()
    changes: dict[str, object] = {}
    if robot is not None:
        if robot not in MODELS:
            known = ", ".join(MODELS)
            raise UsageError(f"there is no robot {robot!r} ({known}).{did_you_mean(robot, MODELS)}")
        changes["model"] = robot
    if pose is not None:
        changes["pose"] = parse_pose(pose)
    return options.model_copy(update={"robot": options.robot.model_copy(update=changes)})


def parse_pose(text: str) -> Pose:
    """Read a pose from a command line, such as ``"1, 0.5, 90 deg"``.

    Raises:
        UsageError: It is not one.
    """
    entries = [part.strip() for part in text.strip().strip("[]").split(",")]
    try:
        return TypeAdapter(PoseInPlane).validate_python(entries)
    except ValidationError as error:
        raise UsageError(f"--pose: {error.errors()[0]['msg']}") from None
