"""The motion of a real robot, from its odometry: what stands for the truth in a bag."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from grader.recording.simulated import Incident, Truth
from grader.recording.tracked import Sighting, truth_of
from grader.spec.expression import yaw
from sim.motion import NS, REST, Pose, Twist, compose, relative

Timed = tuple[int, Mapping[str, Any]]
"""A time in ns and the fields of a message."""
# What goes farther than the fastest robot by more than these is a jump of the odometry.
_NOISE_M = 0.1
_FASTER = 2.0


def motion(
    odometry: Sequence[Timed], commands: Sequence[Timed], start: Pose | None = None
) -> tuple[Truth, ...]:
    """The way of the robot in steps, between the first and the last message of its odometry.

    Args:
        odometry: Messages of nav_msgs/msg/Odometry, oldest first.
        commands: Messages of geometry_msgs/msg/Twist or TwistStamped, oldest first.
        start: The pose that the robot begins at; by default what its odometry says.
    """
    states = [state for state in map(_state, odometry) if state.is_finite]
    states = [
        state
        for index, state in enumerate(states)
        if index == 0 or state.time_ns > states[index - 1].time_ns
    ]
    if start is not None and states:
        first = states[0].pose
        moved = [compose(start, relative(first, state.pose)) for state in states]
        states = [state._replace(pose=pose) for state, pose in zip(states, moved, strict=True)]
    sightings = [Sighting(state.time_ns, state.time_ns, state.pose) for state in states]
    twists = [state.twist for state in states]
    if all(twist == REST for twist in twists):
        # Some drivers fill in the pose alone: the velocities follow from the poses then.
        twists = []
    orders = [(time_ns, twist) for time_ns, twist in _orders(commands) if twist.is_finite]
    return truth_of(sightings, orders, twists=twists)


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
    for before, after in pairwise(map(_state, odometry)):
        way_m = math.hypot(after.pose.x_m - before.pose.x_m, after.pose.y_m - before.pose.y_m)
        longest_m = fastest_m_s * (after.time_ns - before.time_ns) / NS
        if way_m > _NOISE_M + _FASTER * longest_m:
            return after.time_ns, way_m
    return None


class _State(NamedTuple):
    """What one message of odometry says."""

    time_ns: int
    pose: Pose
    twist: Twist

    @property
    def is_finite(self) -> bool:
        """Whether it has numbers that a robot can have."""
        pose = self.pose
        return self.twist.is_finite and all(map(math.isfinite, (pose.x_m, pose.y_m, pose.yaw_rad)))


def _state(message: Timed) -> _State:
    time_ns, value = message
    position, orientation = value["pose"]["pose"]["position"], value["pose"]["pose"]["orientation"]
    heading_rad = yaw(*(float(orientation[key]) for key in "xyzw"))
    pose = Pose(float(position["x"]), float(position["y"]), heading_rad)
    return _State(time_ns, pose, _twist(value["twist"]["twist"]))


def _twist(value: Mapping[str, Any]) -> Twist:
    return Twist(float(value["linear"]["x"]), float(value["angular"]["z"]))
