"""Poses, velocities and exact motion in the plane.

Frames and units follow REP-103 and REP-105: x forward, y left, counter-clockwise angles;
metres, radians, seconds. Plain floats and :mod:`math`: for single numbers they are several
times faster than numpy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Pose:
    """A position and a heading in a parent frame.

    Attributes:
        yaw_rad: In [-pi, pi], counter-clockwise from the parent's x axis.
    """

    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class Twist:
    """A velocity in the robot's own frame, or a command for it; counter-clockwise is positive."""

    linear_m_s: float
    angular_rad_s: float

    def __add__(self, other: Twist) -> Twist:
        """The sum of two velocities."""
        return Twist(self.linear_m_s + other.linear_m_s, self.angular_rad_s + other.angular_rad_s)

    @property
    def is_finite(self) -> bool:
        """Whether neither part is NaN or infinite."""
        return math.isfinite(self.linear_m_s) and math.isfinite(self.angular_rad_s)


ORIGIN = Pose(0.0, 0.0, 0.0)
REST = Twist(0.0, 0.0)


def wrap_angle(angle_rad: float) -> float:
    """The same direction in [-pi, pi]; an angle that is there already keeps its bits."""
    if -math.pi <= angle_rad <= math.pi:
        return angle_rad
    return math.remainder(angle_rad, math.tau)


def integrate(pose: Pose, linear_m_s: float, angular_rad_s: float, duration_s: float) -> Pose:
    """Move along the arc that a constant velocity gives: the exponential map of SE(2).

    The chord of the arc has length ``v t sin(h) / h`` and direction ``yaw + h`` with
    ``h = w t / 2``. This form has no difference of nearly equal numbers, so that it is as
    exact for a tiny angular velocity as for a large one, and it needs no series: the
    quotient ``sin(h) / h`` is right to the last bit down to the smallest ``h`` but zero.
    """
    half_rad = 0.5 * angular_rad_s * duration_s
    chord_m = linear_m_s * duration_s
    if half_rad != 0.0:
        chord_m *= math.sin(half_rad) / half_rad
    direction_rad = pose.yaw_rad + half_rad
    return Pose(
        pose.x_m + chord_m * math.cos(direction_rad),
        pose.y_m + chord_m * math.sin(direction_rad),
        wrap_angle(pose.yaw_rad + angular_rad_s * duration_s),
    )


def compose(parent: Pose, child: Pose) -> Pose:
    """The pose, in the frame of ``parent``'s parent, of what is at ``child`` in ``parent``."""
    cos, sin = math.cos(parent.yaw_rad), math.sin(parent.yaw_rad)
    return Pose(
        parent.x_m + cos * child.x_m - sin * child.y_m,
        parent.y_m + sin * child.x_m + cos * child.y_m,
        wrap_angle(parent.yaw_rad + child.yaw_rad),
    )


def relative(parent: Pose, pose: Pose) -> Pose:
    """The inverse of :func:`compose`: ``pose`` as seen from ``parent``."""
    cos, sin = math.cos(parent.yaw_rad), math.sin(parent.yaw_rad)
    dx_m, dy_m = pose.x_m - parent.x_m, pose.y_m - parent.y_m
    return Pose(
        cos * dx_m + sin * dy_m,
        cos * dy_m - sin * dx_m,
        wrap_angle(pose.yaw_rad - parent.yaw_rad),
    )
