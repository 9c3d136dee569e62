"""The way of a robot to a pose: it turns, drives straight, and turns again. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from grader.findings.value import NoSuchField
from grader.spec.expression import yaw
from sim.motion import Pose, Twist

_ARRIVED_M, _ARRIVED_RAD = 0.03, 0.02
_TURN_FIRST_RAD = 0.3
"""Beyond this angle to the goal it turns on the spot, so that it does not leave in a wide arc."""
_GAIN_PER_S = 2.0


class Target(NamedTuple):
    """A pose to drive to; without a heading any will do."""

    x_m: float
    y_m: float
    yaw_rad: float | None


def target(goal: Mapping[str, Any], path: str) -> Target:
    """The pose in a field of a goal, in any of the messages for it."""
    value: Any = goal
    for name in path.split("."):
        if name not in value:
            raise NoSuchField(f"the goal has no field {path}")
        value = value[name]
    # A PoseStamped holds a Pose; a Point and a Pose2D hold x and y themselves.
    while "pose" in value:
        value = value["pose"]
    position, rotation = value.get("position", value), value.get("orientation", {})
    yaw_rad = value.get("theta")
    # A quaternion of zeros stands for any heading.
    if any(rotation.values()):
        yaw_rad = yaw(*(rotation[name] for name in "xyzw"))
    return Target(position["x"], position["y"], yaw_rad)


def distance_m(pose: Pose, goal: Target) -> float:
    """How far it is."""
    return math.hypot(goal.x_m - pose.x_m, goal.y_m - pose.y_m)


def command(pose: Pose, goal: Target, speed_m_s: float) -> Twist | None:
    """The velocity to command now; None at the goal."""
    remaining_m = distance_m(pose, goal)
    if remaining_m > _ARRIVED_M:
        bearing_rad = math.atan2(goal.y_m - pose.y_m, goal.x_m - pose.x_m)
        error_rad = math.remainder(bearing_rad - pose.yaw_rad, math.tau)
        is_ahead = abs(error_rad) < _TURN_FIRST_RAD
        forward_m_s = min(speed_m_s, _GAIN_PER_S * remaining_m) if is_ahead else 0.0
        return Twist(forward_m_s, _GAIN_PER_S * error_rad)
    if goal.yaw_rad is None:
        return None
    error_rad = math.remainder(goal.yaw_rad - pose.yaw_rad, math.tau)
    return Twist(0.0, _GAIN_PER_S * error_rad) if abs(error_rad) > _ARRIVED_RAD else None
