"""Wheel odometry: the robot's own belief of where it is.

Without drift it is the true motion. With drift each wheel's way is measured with errors, after
J. Borenstein and L. Feng, "Measurement and Correction of Systematic Odometry Errors in Mobile
Robots" (1996): unequal wheel radii and a wrong wheel separation, constant in a run; and slip,
a random walk whose variance grows with the way of the wheel (R. Siegwart and I. Nourbakhsh,
"Introduction to Autonomous Mobile Robots", section 5.2.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.description import OdometryOptions, OdometryOrigin
from sim.motion import ORIGIN, Pose, Twist, integrate, relative


@dataclass(frozen=True, slots=True)
class OdometrySample:
    """What odometry says at a moment: base_footprint in the frame ``odom``."""

    time_ns: int
    pose: Pose
    twist: Twist


class WheelOdometry:
    """Integrates the ways of the wheels."""

    def __init__(
        self,
        options: OdometryOptions,
        start: Pose,
        wheel_separation_m: float,
        random: np.random.Generator,
    ) -> None:
        """Begin at rest.

        Args:
            start: True pose of the robot at the beginning, in the world's frame.
        """
        drift = options.drift
        self._origin = ORIGIN if options.origin is OdometryOrigin.WORLD else start
        self._is_exact = not (drift.radius or drift.separation or drift.slip)
        self._belief = relative(self._origin, start)
        self._separation_m = wheel_separation_m
        self._slip_m = drift.slip
        self._random = random
        left, right, separation = random.standard_normal(3).tolist()
        self._left = 1.0 + drift.radius * left
        self._right = 1.0 + drift.radius * right
        self._believed_separation_m = wheel_separation_m * (1.0 + drift.separation * separation)

    def move(self, way_m: float, turn_rad: float) -> None:
        """Take a step of the true motion into account, counter-clockwise turns positive."""
        if self._is_exact or (way_m == 0.0 and turn_rad == 0.0):
            return
        left_m = self._measured(way_m - 0.5 * turn_rad * self._separation_m, self._left)
        right_m = self._measured(way_m + 0.5 * turn_rad * self._separation_m, self._right)
        turn = (right_m - left_m) / self._believed_separation_m
        self._belief = integrate(self._belief, 0.5 * (left_m + right_m), turn, 1.0)

    def sample(self, time_ns: int, pose: Pose, twist: Twist) -> OdometrySample:
        """What odometry says now.

        Args:
            pose: The true pose in the world's frame, which exact odometry reports.
        """
        if not self._is_exact:
            pose = self._belief
        elif self._origin is not ORIGIN:
            pose = relative(self._origin, pose)
        return OdometrySample(time_ns, pose, twist)

    def _measured(self, way_m: float, factor: float) -> float:
        slip_m = self._slip_m and self._slip_m * self._random.standard_normal()
        return way_m * factor + slip_m * math.sqrt(abs(way_m))
