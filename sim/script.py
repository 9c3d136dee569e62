"""Obstacles that move on a script: a pure function of simulated time, so no run differs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from sim.motion import Pose, wrap_angle
from sim.shapes import Shape, box, circle

MAX_SPEED_M_S = 5.0
"""Fastest obstacle. Contact with it is looked for at every step of 10 ms: at 5 m/s it moves
5 cm in one, less than half of any robot, so that it cannot jump over one."""


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A pose in the world's frame at a simulated time."""

    at_ns: int
    pose: Pose


@dataclass(frozen=True, slots=True)
class MovingObstacle:
    """A circle or a box that follows timed waypoints in straight lines.

    Attributes:
        label: Where it is in the YAML, such as ``moving[0]``.
        path: At least one waypoint, times increasing. Before the first it stands there, after
            the last it stays (or starts over, if ``repeat``).
        radius_m: Of a circle, or None.
        size_m: Length and width of a box, or None.
        disappears_ns: It is gone from this time on, or None.
    """

    label: str
    path: tuple[Waypoint, ...]
    radius_m: float | None = None
    size_m: tuple[float, float] | None = None
    appears_ns: int = 0
    disappears_ns: int | None = None
    repeat: bool = False
    line: int | None = None

    @property
    def reach_m(self) -> float:
        """Radius of the circle around its pose that encloses it."""
        if self.radius_m is not None:
            return self.radius_m
        length_m, width_m = self.size_m or (0.0, 0.0)
        return 0.5 * math.hypot(length_m, width_m)

    def pose_at(self, time_ns: int) -> Pose | None:
        """Where it is at a simulated time, or None where it is not there."""
        if time_ns < self.appears_ns:
            return None
        if self.disappears_ns is not None and time_ns >= self.disappears_ns:
            return None
        path = self.path
        first, last = path[0], path[-1]
        if self.repeat and time_ns > last.at_ns > first.at_ns:
            time_ns = first.at_ns + (time_ns - first.at_ns) % (last.at_ns - first.at_ns)
        if time_ns <= first.at_ns:
            return first.pose
        if time_ns >= last.at_ns:
            return last.pose
        before, after = next(pair for pair in pairwise(path) if time_ns < pair[1].at_ns)
        share = (time_ns - before.at_ns) / (after.at_ns - before.at_ns)
        a, b = before.pose, after.pose
        return Pose(
            a.x_m + share * (b.x_m - a.x_m),
            a.y_m + share * (b.y_m - a.y_m),
            wrap_angle(a.yaw_rad + share * wrap_angle(b.yaw_rad - a.yaw_rad)),
        )

    def shape_at(self, pose: Pose) -> Shape:
        """Its outline when it is at a pose."""
        if self.radius_m is not None:
            return circle(self.label, pose.x_m, pose.y_m, self.radius_m, self.line)
        return box(self.label, pose, self.size_m or (0.0, 0.0), self.line)
