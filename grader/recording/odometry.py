"""The motion of a real robot, from its odometry: what stands for the truth in a bag."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from grader.recording.simulated import Incident, Truth
from grader.recording.tracked import Sighting, truth_of
from sim.motion import REST, Pose, Twist, compose, relative

Timed = tuple[int, Mapping[str, Any]]
"""A time in ns and the fields of a message."""


def motion(
    odometry: Sequence[Timed], commands: Sequence[Timed], start: Pose | None = None
) -> tuple[Truth, ...]:
    """The way of the robot in steps, between the first and the last message of its odometry.

    Args:
        odometry: Messages of nav_msgs/msg/Odometry, oldest first.
        commands: Messages of geometry_msgs/msg/Twist or TwistStamped, oldest first.
        start: The pose that the robot begins at; by default what its odometry says.
    """
    told = [one for one in map(_read, odometry) if _is_finite(one[1]) and one[2].is_finite]
    told = [one for index, one in enumerate(told) if index == 0 or one[0] > told[index - 1][0]]
    if start is not None and told:
        first = told[0][1]
        told = [(at, compose(start, relative(first, pose)), twist) for at, pose, twist in told]
    seen = [Sighting(time_ns, time_ns, pose) for time_ns, pose, _ in told]
    twists = [twist for _, _, twist in told]
    # Some drivers fill in the pose alone.
    said = twists if any(twist != REST for twist in twists) else ()
    return truth_of(seen, [one for one in _orders(commands) if one[1].is_finite], twists=said)


def rejected(commands: Sequence[Timed]) -> tuple[Incident, ...]:
    """Commands that are not finite, which no robot can follow."""
    return tuple(
        Incident(
            time_ns,
            "command_rejected",
            f"linear.x = {twist.linear_m_s:g}, angular.z = {twist.angular_rad_s:g}",
        )
        for time_ns, twist in _orders(commands)
        if not twist.is_finite
    )


def _orders(commands: Sequence[Timed]) -> Iterator[tuple[int, Twist]]:
    for time_ns, value in commands:
        yield time_ns, _twist(value.get("twist", value))


def jump(odometry: Sequence[Timed], fastest_m_s: float) -> tuple[int, float] | None:
    """When the odometry first goes farther than any robot can, and how far in m; or None."""
    for (before_ns, one), (after_ns, other) in pairwise(odometry):
        pose, after = _read((before_ns, one))[1], _read((after_ns, other))[1]
        way_m = math.hypot(after.x_m - pose.x_m, after.y_m - pose.y_m)
        if way_m > 0.1 + 2.0 * fastest_m_s * (after_ns - before_ns) / 1e9:
            return after_ns, way_m
    return None


def _read(message: Timed) -> tuple[int, Pose, Twist]:
    time_ns, value = message
    place, turn = value["pose"]["pose"]["position"], value["pose"]["pose"]["orientation"]
    x, y, z, w = (float(turn[key]) for key in "xyzw")
    yaw_rad = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    pose = Pose(float(place["x"]), float(place["y"]), yaw_rad)
    return time_ns, pose, _twist(value["twist"]["twist"])


def _twist(value: Mapping[str, Any]) -> Twist:
    return Twist(float(value["linear"]["x"]), float(value["angular"]["z"]))


def _is_finite(pose: Pose) -> bool:
    return all(map(math.isfinite, (pose.x_m, pose.y_m, pose.yaw_rad)))
