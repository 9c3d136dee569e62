"""The LiDAR: every ray against every line segment and circle, all at once in numpy.

All beams of a scan are taken at one instant (``time_increment`` is 0). Shapes are seen as
their outlines.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.description import Layout, LidarOptions, NoReturn
from sim.motion import Pose, compose
from sim.shapes import Shape
from sim.world import World

Floats = NDArray[np.float64]

_ROUNDING_M = 1e-9
"""A ray that misses an end by less still counts, so that none slips through a corner."""
_AT_ONCE = 1_000_000
"""Pairs of a beam and a wall, for the memory that they take."""
_BRIGHTNESS = 2000.0
"""Intensity at no distance, about as the LDS-01 reports it of a white wall."""


@dataclass(frozen=True, slots=True)
class Scan:
    """One turn of the LiDAR, as it is reported: ranges of shape (beams,).

    What a beam without a distance holds is set by :class:`~sim.description.NoReturn`.
    """

    time_ns: int
    ranges_m: NDArray[np.float32]

    @property
    def intensities(self) -> NDArray[np.float32]:
        """Shape (beams,), without a unit: less with the distance, 0 where there is none."""
        falling = _BRIGHTNESS / (1.0 + self.ranges_m**2)
        return np.where(self.ranges_m == 0.0, 0.0, falling).astype(np.float32)


class Rays:
    """Rays from a sensor on a robot into a world."""

    def __init__(self, world: World, pose: Pose, angles_rad: Floats, range_max_m: float) -> None:
        """Prepare the world's walls.

        Args:
            pose: Of the sensor on the robot.
            angles_rad: Of the rays, counter-clockwise from the sensor's x axis, shape (rays,).
        """
        self._world, self._pose, self.angles_rad = world, pose, angles_rad
        self._range_max_m = range_max_m
        self._capsules = _capsules(world.shapes)

    def cast(self, pose: Pose, time_ns: int) -> Floats:
        """True distances from a robot at a pose in the world's frame.

        Returns:
            Shape (rays,), metres, in the order of the rays; inf where nothing is within range.
        """
        sensor, rays = compose(pose, self._pose), len(self.angles_rad)
        ranges = np.full(rays, np.inf)
        for capsules in (self._capsules, _capsules(self._world.moving_at(time_ns))):
            parts = 1 + rays * len(capsules) // _AT_ONCE
            for part in np.array_split(capsules, parts):
                is_wall = part[:, 4] == 0.0
                np.minimum(ranges, self._to_walls(part[is_wall], sensor), out=ranges)
                np.minimum(ranges, self._to_circles(part[~is_wall], sensor), out=ranges)
        ranges[ranges > self._range_max_m] = np.inf
        return ranges

    def _to_walls(self, walls: Floats, sensor: Pose) -> Floats:
        """How far each beam goes until it meets one of some walls; inf where it meets none."""
        ahead_a, left_a = self._from_beams(walls[:, 0], walls[:, 1], sensor)
        ahead_b, left_b = self._from_beams(walls[:, 2], walls[:, 3], sensor)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.clip(left_a / (left_a - left_b), 0.0, 1.0)
        distance = ahead_a + share * (ahead_b - ahead_a)
        # Seen along its length a wall has no width: the nearer end counts.
        distance = np.where(np.isnan(share), np.minimum(ahead_a, ahead_b), distance)
        meets = (distance >= 0.0) & (np.minimum(left_a, left_b) <= _ROUNDING_M)
        meets &= np.maximum(left_a, left_b) >= -_ROUNDING_M
        return _nearest(distance, meets)

    def _to_circles(self, circles: Floats, sensor: Pose) -> Floats:
        """The same for circles."""
        ahead, left = self._from_beams(circles[:, 0], circles[:, 1], sensor)
        radius = circles[:, 4]
        depth = np.sqrt(np.maximum(0.0, radius**2 - left**2))
        distance = np.where(np.hypot(ahead, left) > radius, ahead - depth, ahead + depth)
        return _nearest(distance, (distance >= 0.0) & (np.abs(left) <= radius))

    def _from_beams(self, x_m: Floats, y_m: Floats, sensor: Pose) -> tuple[Floats, Floats]:
        """How far points lie ahead and to the left of each beam, shape (beams, points) each."""
        yaw_rad = sensor.yaw_rad + self.angles_rad[:, np.newaxis]
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        dx, dy = x_m - sensor.x_m, y_m - sensor.y_m
        return cos * dx + sin * dy, cos * dy - sin * dx


class Lidar:
    """A LiDAR in a world."""

    def __init__(self, world: World, options: LidarOptions) -> None:
        """Prepare its beams."""
        self.options = options
        self.angle_min_rad = 0.0 if options.layout is Layout.FROM_ZERO else -math.pi
        self.angle_increment_rad = math.tau / options.beams
        self.angle_max_rad = self.angle_min_rad + (options.beams - 1) * self.angle_increment_rad
        self.angles_rad = self.angle_min_rad + np.arange(options.beams) * self.angle_increment_rad
        self._rays = Rays(world, options.pose, self.angles_rad, options.range_max)

    def cast(self, pose: Pose, time_ns: int) -> Floats:
        """True distances from a robot at a pose, in the order of the beams; see :class:`Rays`."""
        return self._rays.cast(pose, time_ns)

    def scan(self, pose: Pose, time_ns: int, noise: np.random.Generator) -> Scan:
        """Take a scan.

        Args:
            noise: One number is drawn for each beam in every scan, so that a scan does not
                change the noise of the next; none without noise.
        """
        options = self.options
        ranges = self.cast(pose, time_ns)
        if options.noise:
            ranges += options.noise * noise.standard_normal(options.beams)
        is_zero = options.no_return is NoReturn.ZERO
        ranges[ranges > options.range_max] = 0.0 if is_zero else np.inf
        ranges[ranges < options.range_min] = 0.0 if is_zero else -np.inf
        return Scan(time_ns, ranges.astype(np.float32))


def _nearest(distance: Floats, meets: NDArray[np.bool_]) -> Floats:
    nearest: Floats = np.where(meets, distance, np.inf).min(axis=1, initial=np.inf)
    return nearest


def _capsules(shapes: Iterable[Shape]) -> Floats:
    """Shape (n, 5): x1, y1, x2, y2, radius, which is zero for a wall."""
    found = [capsule for shape in shapes for capsule in shape.capsules]
    return np.array(found, dtype=float).reshape(-1, 5)
