"""What a robot has besides LiDAR and odometry: IMU, wheel joints, battery, distance sensors.

Each takes part in every step, and is read when a message of it is due. Pure; no ROS.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from sim.description import SimulatorOptions
from sim.lidar import Rays
from sim.motion import NS, REST, Pose, Twist
from sim.sensor_options import (
    BatteryOptions,
    ImuOptions,
    JointOptions,
    RangeOptions,
    SensorOptions,
)
from sim.world import World

GRAVITY_M_S2 = 9.80665
_RAY_RAD = math.radians(1.0)
"""At most so far apart are the rays in the cone of a distance sensor."""


class Sensor(Protocol):
    """A sensor of one robot."""

    @property
    def options(self) -> SensorOptions:
        """As in YAML."""

    def take_part(self, motion: Twist, step_s: float) -> None:
        """Take the true motion of a step into account."""

    def read(self, pose: Pose, time_ns: int) -> Any:
        """What it measures at the end of a step, with the robot at its true pose."""


@dataclass(frozen=True, slots=True)
class Inertia:
    """What an IMU measures, in its own frame: x ahead, y left, counter-clockwise positive."""

    yaw_rad: float
    angular_rad_s: float
    ahead_m_s2: float
    left_m_s2: float
    up_m_s2: float


class Imu:
    """An IMU on a robot in the plane."""

    def __init__(self, options: ImuOptions, noise: np.random.Generator) -> None:
        """Begin at rest."""
        self.options, self._noise = options, noise
        self._before, self._now, self._step_s = REST, REST, 1.0

    def take_part(self, motion: Twist, step_s: float) -> None:
        """Keep the velocities of the last two steps."""
        self._before, self._now, self._step_s = self._now, motion, step_s

    def read(self, pose: Pose, time_ns: int) -> Inertia:
        """The acceleration of its place r on a body: v' + w' x r + w x (v + w x r)."""
        turn, at = self._now.angular_rad_s, self.options.pose
        ahead = (self._now.linear_m_s - self._before.linear_m_s) / self._step_s
        faster = (turn - self._before.angular_rad_s) / self._step_s
        x = ahead - faster * at.y_m - turn * turn * at.x_m
        y = turn * self._now.linear_m_s + faster * at.x_m - turn * turn * at.y_m
        cos, sin = math.cos(at.yaw_rad), math.sin(at.yaw_rad)
        errors = self._noise.standard_normal(4).tolist()
        angular, linear = self.options.noise.angular, self.options.noise.linear
        return Inertia(
            math.remainder(pose.yaw_rad + at.yaw_rad, math.tau),
            turn + angular * errors[0],
            cos * x + sin * y + linear * errors[1],
            cos * y - sin * x + linear * errors[2],
            GRAVITY_M_S2 + linear * errors[3],
        )


@dataclass(frozen=True, slots=True)
class Joints:
    """Angles (rad) and speeds (rad/s) of the left and of the right wheel."""

    angles_rad: tuple[float, float]
    speeds_rad_s: tuple[float, float]


class Wheels:
    """The two wheels of a differential drive, which do not slip."""

    def __init__(self, options: JointOptions, separation_m: float) -> None:
        """Begin at angle 0."""
        self.options, self._separation_m = options, separation_m
        self._angles = self._speeds = (0.0, 0.0)

    def take_part(self, motion: Twist, step_s: float) -> None:
        """Turn the wheels."""
        aside = 0.5 * self._separation_m * motion.angular_rad_s
        radius = self.options.wheel_radius
        left, right = (motion.linear_m_s - aside) / radius, (motion.linear_m_s + aside) / radius
        self._speeds = (left, right)
        self._angles = (self._angles[0] + left * step_s, self._angles[1] + right * step_s)

    def read(self, pose: Pose, time_ns: int) -> Joints:
        """The true angles."""
        return Joints(self._angles, self._speeds)


class Battery:
    """A battery whose charge falls with time."""

    def __init__(self, options: BatteryOptions) -> None:
        """Begin with the charge of the options."""
        self.options = options

    def take_part(self, motion: Twist, step_s: float) -> None:
        """Nothing: driving takes little of what the computer takes."""

    def read(self, pose: Pose, time_ns: int) -> float:
        """The charge as a share, from 0 to 1."""
        return max(0.0, self.options.charge - time_ns / NS / self.options.lasts)


class DistanceSensor:
    """A sonar, or an infrared sensor."""

    def __init__(self, world: World, options: RangeOptions, noise: np.random.Generator) -> None:
        """Prepare the rays of the cone."""
        self.options, self._noise = options, noise
        rays = 1 + math.ceil(options.fov / _RAY_RAD)
        half = 0.5 * options.fov
        self._rays = Rays(world, options.pose, np.linspace(-half, half, rays), options.range_max)

    def take_part(self, motion: Twist, step_s: float) -> None:
        """Nothing: only the pose counts."""

    def read(self, pose: Pose, time_ns: int) -> float:
        """The distance to the nearest thing, in m: inf beyond the range, -inf below (REP-117)."""
        nearest = float(self._rays.cast(pose, time_ns).min())
        nearest += self.options.noise * float(self._noise.standard_normal())
        if nearest > self.options.range_max:
            return math.inf
        return nearest if nearest >= self.options.range_min else -math.inf


def sensors_of(
    world: World, options: SimulatorOptions, wheel_separation_m: float, seeds: Iterable[object]
) -> Iterator[Sensor]:
    """The sensors that the YAML describes, each with its own noise."""
    noise = (np.random.default_rng(seed) for seed in seeds)  # type: ignore[arg-type]
    if options.imu is not None:
        yield Imu(options.imu, next(noise))
    if options.joint_states is not None:
        yield Wheels(options.joint_states, wheel_separation_m)
    if options.battery is not None:
        yield Battery(options.battery)
    for one in options.ranges:
        yield DistanceSensor(world, one, next(noise))
