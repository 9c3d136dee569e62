"""The simulator alone, for a student to drive against, with a live view in the terminal."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import rclpy
from pydantic import TypeAdapter, ValidationError
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions
from rich.console import Console
from rich.live import Live

from grader.errors import UsageError
from grader.spec.nearest_name import did_you_mean
from sim.coordinates import PoseInPlane
from sim.description import SimulatorOptions, read_options
from sim.motion import NS, Pose
from sim.node import RosSimulator, make_node
from sim.real_time import RealTime
from sim.robot import MODELS
from sim.screen import Screen
from sim.simulation import Simulation
from sim.turtles.screen import TurtleScreen
from sim.turtles.simulation import Turtles
from sim.world import World, read_world

_REFRESH_NS = NS // 10
_LINE_NS = NS


def described(
    world: Path, values: Sequence[str], options: Path | None, robot: str | None, pose: str | None
) -> tuple[World, SimulatorOptions]:
    """The world and the options that a command line describes.

    Args:
        values: Of the world, each as ``NAME=VALUE``.
        options: File with robot, sensors and topics, or None for the defaults.
    """
    return read_world(world, _read_values(values)), _options(options, robot, pose)


def run(
    simulation: Simulation, *, domain_id: int | None = None, duration: float | None = None
) -> None:
    """Simulate in real time until Ctrl-C, with a view on a terminal, else a line in a second.

    Args:
        domain_id: ROS domain, or None for ROS_DOMAIN_ID.
        duration: End after so many simulated seconds, or None.
    """
    with _context(domain_id) as context:
        node: Any = make_node("rosgrade_sim", context)
        screen = Screen(simulation)
        simulator = RosSimulator(node, {"": simulation}, screen)
        screen.robot = simulator.robots[""]
        _loop(simulator, screen, duration)
        node.destroy_node()


def run_turtles(
    turtles: Turtles, *, domain_id: int | None = None, duration: float | None = None
) -> None:
    """The same for turtles; the interfaces of turtlesim must be importable."""
    from sim.turtles.node import RosTurtles
    from sim.turtles.node import make_node as make_turtles_node

    with _context(domain_id) as context:
        node: Any = make_turtles_node(context)
        screen = TurtleScreen()
        _loop(RosTurtles(node, turtles, screen), screen, duration)
        node.destroy_node()


@contextmanager
def _context(domain_id: int | None) -> Iterator[Context]:
    """A context that signals do not end, but Ctrl-C and SIGTERM end what is done in it."""
    context = Context()
    # Ctrl-C is handled here: rclpy's handler would shut the context down within a step.
    rclpy.init(
        args=[],
        context=context,
        domain_id=domain_id,
        signal_handler_options=SignalHandlerOptions.NO,
    )
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield context
    finally:
        signal.signal(signal.SIGTERM, before)
        context.try_shutdown()


def _loop(simulator: RealTime, screen: Screen | TurtleScreen, duration: float | None) -> None:
    with suppress(KeyboardInterrupt):
        _keep_time(simulator, screen, None if duration is None else round(duration * NS))


def _keep_time(simulator: RealTime, screen: Screen | TurtleScreen, end_ns: int | None) -> None:
    console = Console()
    # We refresh it ourselves between two steps; a thread of rich's would disturb them.
    live = Live(console=console, screen=True, auto_refresh=False, redirect_stdout=False)
    is_terminal = sys.stdout.isatty()
    every_ns = _REFRESH_NS if is_terminal else _LINE_NS
    next_ns = every_ns
    with live if is_terminal else nullcontext():
        deadline_ns = simulator.start()
        while end_ns is None or screen.time_ns < end_ns:
            time.sleep(max(0.0, (deadline_ns - time.monotonic_ns()) / NS))
            deadline_ns = simulator.catch_up()
            # Never draw while steps wait.
            if screen.time_ns < next_ns or deadline_ns <= time.monotonic_ns():
                continue
            next_ns = (screen.time_ns // every_ns + 1) * every_ns
            if is_terminal:
                live.update(screen.picture(*console.size), refresh=True)
            else:
                print(screen.line(), flush=True)


def _read_values(texts: Sequence[str]) -> dict[str, str]:
    for text in texts:
        if "=" not in text:
            raise UsageError(f"--set {text}: write NAME=VALUE")
    return dict(text.split("=", 1) for text in texts)


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
    """Read a pose from a command line, such as ``"1, 0.5, 90 deg"``."""
    entries = [part.strip() for part in text.strip().strip("[]").split(",")]
    try:
        return TypeAdapter(PoseInPlane).validate_python(entries)
    except ValidationError as error:
        raise UsageError(f"--pose: {error.errors()[0]['msg']}") from None
