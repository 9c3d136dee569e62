"""The way of a robot to a pose: it turns, drives straight, and turns again. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from grader.findings.value import NoSuchField
from grader.spec.expression import yaw
from sim.motion import Pose, Twist

_THERE_M, _THERE_RAD = 0.03, 0.02
_TURN_FIRST_RAD = 0.3
_GAIN_PER_S = 2.0

Target = tuple[float, float, float | None]
"""Position in m and heading in rad, or None for any heading."""


def target(goal: Mapping[str, Any], path: str) -> Target:
    """The pose in a field of a goal, in any of the messages for it."""
    here: Any = goal
    for step in path.split("."):
        if step not in here:
            raise NoSuchField(f"the goal has no field {path}")
        here = here[step]
    while "pose" in here:
        here = here["pose"]
    position, rotation = here.get("position", here), here.get("orientation", {})
    yaw_rad = here.get("theta")
    if any(rotation.values()):
        yaw_rad = yaw(*(rotation[name] for name in "xyzw"))
    return position["x"], position["y"], yaw_rad


def distance_m(pose: Pose, goal: Target) -> float:
    """How far it is."""
    return math.hypot(goal[0] - pose.x_m, goal[1] - pose.y_m)


def command(pose: Pose, goal: Target, speed_m_s: float) -> Twist | None:
    """The velocity to command now; None at the goal."""
    left_m, wanted_rad = distance_m(pose, goal), goal[2]
    if left_m > _THERE_M:
        bearing_rad = math.atan2(goal[1] - pose.y_m, goal[0] - pose.x_m)
        error_rad = math.remainder(bearing_rad - pose.yaw_rad, math.tau)
        is_ahead = abs(error_rad) < _TURN_FIRST_RAD
        forward_m_s = min(speed_m_s, _GAIN_PER_S * left_m) if is_ahead else 0.0
        return Twist(forward_m_s, _GAIN_PER_S * error_rad)
    error_rad = 0.0 if wanted_rad is None else math.remainder(wanted_rad - pose.yaw_rad, math.tau)
    return Twist(0.0, _GAIN_PER_S * error_rad) if abs(error_rad) > _THERE_RAD else None
