"""The way of the robot to the pose of a goal."""

from __future__ import annotations

import math

import pytest

from grader.run.stimuli.driving import Target, command, distance_m, target
from sim.description import SimulatorOptions
from sim.simulation import make_simulation
from sim.world import parse_world

TURNED = {"x": 0.0, "y": 0.0, "z": math.sin(0.5), "w": math.cos(0.5)}
NONE = dict.fromkeys("xyzw", 0.0)


@pytest.mark.parametrize(
    ("goal", "path", "yaw_rad"),
    [
        ({"pose": {"pose": {"position": {"x": 1.0, "y": 2.0}, "orientation": TURNED}}}, "pose", 1),
        ({"to": {"position": {"x": 1.0, "y": 2.0}, "orientation": NONE}}, "to", None),
        ({"a": {"b": {"x": 1.0, "y": 2.0, "theta": 0.5}}}, "a.b", 0.5),
        ({"point": {"x": 1.0, "y": 2.0, "z": 0.0}}, "point", None),
    ],
)
def test_a_pose_is_read_from_any_message(goal: object, path: str, yaw_rad: float | None) -> None:
    found = target(goal, path)  # type: ignore[arg-type]
    assert found[:2] == (1.0, 2.0)
    assert found[2] == (yaw_rad if yaw_rad is None else pytest.approx(yaw_rad))


@pytest.mark.parametrize(
    "goal", [Target(1.0, 0.0, None), Target(-0.5, 0.5, 1.5), Target(0.0, -0.7, 3.1)]
)
def test_the_robot_arrives_and_stops(goal: Target) -> None:
    simulation = make_simulation(parse_world("{}"), SimulatorOptions(), seed=1)
    for _ in range(1500):
        twist = command(simulation.pose, goal, 0.2)
        if twist is None:
            break
        for _ in range(2):
            simulation.advance(twist)
    assert distance_m(simulation.pose, goal) < 0.04
    if goal[2] is not None:
        assert abs(math.remainder(simulation.pose.yaw_rad - goal[2], math.tau)) < 0.05
