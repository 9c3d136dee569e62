"""The LiDAR: rays against line segments and circles, all at once in numpy.

A scan is taken in the sensor's frame. Each wall covers a run of neighbouring beams, which
follows from the directions of its two ends; only these pairs of beam and wall are
intersected. So the cost grows with what is seen and not with beams times walls.

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
Ints = NDArray[np.int64]

_BEAM_MARGIN = 1e-9
"""In beams: a ray that misses an end by rounding still counts, so that no ray slips through
the corner of a polygon."""
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


class Lidar:
    """A LiDAR in a world."""

    def __init__(self, world: World, options: LidarOptions) -> None:
        """Prepare the world's walls."""
        self.options = options
        self.angle_min_rad = 0.0 if options.layout is Layout.FROM_ZERO else -math.pi
        self.angle_increment_rad = math.tau / options.beams
        self.angle_max_rad = self.angle_min_rad + (options.beams - 1) * self.angle_increment_rad
        self._world = world
        self._walls = _outlines(world.shapes)
        self.angles_rad = self.angle_min_rad + np.arange(options.beams) * self.angle_increment_rad
        self._cos, self._sin = np.cos(self.angles_rad), np.sin(self.angles_rad)

    def cast(self, pose: Pose, time_ns: int) -> Floats:
        """True distances from a robot at a pose in the world's frame.

        Returns:
            Shape (beams,), metres, in the order of the beams; inf where nothing is within
            ``range_max``.
        """
        sensor = compose(pose, self.options.pose)
        ranges = np.full(self.options.beams, np.inf)
        self._see(self._walls, sensor, ranges)
        if self._world.moving:
            self._see(_outlines(self._world.moving_at(time_ns)), sensor, ranges)
        ranges[ranges > self.options.range_max] = np.inf
        return ranges

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

    def _see(self, outlines: tuple[Floats, Floats], sensor: Pose, ranges: Floats) -> None:
        segments, circles = outlines
        if segments.size:
            self._see_segments(segments, sensor, ranges)
        if circles.size:
            self._see_circles(circles, sensor, ranges)

    def _see_segments(self, segments: Floats, sensor: Pose, ranges: Floats) -> None:
        ax, ay = _into_frame(segments[0], segments[1], sensor)
        bx, by = _into_frame(segments[2], segments[3], sensor)
        ex, ey = bx - ax, by - ay
        # Nearest point of each wall, to leave out what is beyond the range.
        along = np.clip(-(ax * ex + ay * ey) / (ex * ex + ey * ey), 0.0, 1.0)
        nearest = np.hypot(ax + along * ex, ay + along * ey)
        seen = nearest <= self.options.range_max
        if not seen.all():
            ax, ay, bx, by, ex, ey = (item[seen] for item in (ax, ay, bx, by, ex, ey))
            nearest = nearest[seen]
        offset = ax * ey - ay * ex
        begin, end = np.arctan2(ay, ax), np.arctan2(by, bx)
        sweep = np.remainder(end - begin + math.pi, math.tau) - math.pi
        wall, beam = self._pairs(np.where(sweep >= 0.0, begin, end), np.abs(sweep))
        slope = self._cos[beam] * ey[wall] - self._sin[beam] * ex[wall]
        end_a, end_b = np.hypot(ax, ay), np.hypot(bx, by)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = offset[wall] / slope
        # Seen along its length a wall has no width: the nearer end counts.
        distance = np.where(np.isfinite(distance), distance, np.minimum(end_a, end_b)[wall])
        distance = np.clip(distance, nearest[wall], np.maximum(end_a, end_b)[wall])
        np.minimum.at(ranges, beam, distance)

    def _see_circles(self, circles: Floats, sensor: Pose, ranges: Floats) -> None:
        x, y = _into_frame(circles[0], circles[1], sensor)
        radius = circles[2]
        centre = np.hypot(x, y)
        seen = np.abs(centre - radius) <= self.options.range_max
        x, y, radius, centre = x[seen], y[seen], radius[seen], centre[seen]
        outside = centre > radius
        half = np.where(
            outside, np.arcsin(np.minimum(1.0, radius / np.maximum(centre, radius))), math.pi
        )
        circle, beam = self._pairs(np.arctan2(y, x) - half, 2.0 * half)
        cos, sin = self._cos[beam], self._sin[beam]
        along = cos * x[circle] + sin * y[circle]
        across = cos * y[circle] - sin * x[circle]
        depth = np.sqrt(np.maximum(0.0, radius[circle] ** 2 - across**2))
        distance = np.where(outside[circle], along - depth, along + depth)
        np.minimum.at(ranges, beam, np.maximum(distance, 0.0))

    def _pairs(self, begin_rad: Floats, sweep_rad: Floats) -> tuple[Ints, Ints]:
        """All pairs of a wall and a beam that meets it, as indices of shape (pairs,) each.

        Args:
            begin_rad: Shape (walls,), clockwise end of each wall as a direction.
            sweep_rad: Shape (walls,), how far it reaches counter-clockwise from there.
        """
        begin = (begin_rad - self.angle_min_rad) / self.angle_increment_rad
        end = begin + sweep_rad / self.angle_increment_rad
        first = np.ceil(begin - _BEAM_MARGIN).astype(np.int64)
        last = np.floor(end + _BEAM_MARGIN).astype(np.int64)
        count = np.clip(last - first + 1, 0, self.options.beams)
        wall = np.repeat(np.arange(count.size), count)
        before = np.cumsum(count) - count
        beam = np.arange(wall.size) - before[wall] + first[wall]
        return wall, np.remainder(beam, self.options.beams)


def _outlines(shapes: Iterable[Shape]) -> tuple[Floats, Floats]:
    """Segments, shape (4, n): x1, y1, x2, y2; and circles, shape (3, m): x, y, radius."""
    capsules = [capsule for shape in shapes for capsule in shape.capsules]
    segments = [item[:4] for item in capsules if item[4] == 0.0]
    circles = [(item[0], item[1], item[4]) for item in capsules if item[4] > 0.0]
    return (
        np.array(segments, dtype=float).reshape(-1, 4).T.copy(),
        np.array(circles, dtype=float).reshape(-1, 3).T.copy(),
    )


def _into_frame(x: Floats, y: Floats, sensor: Pose) -> tuple[Floats, Floats]:
    cos, sin = math.cos(sensor.yaw_rad), math.sin(sensor.yaw_rad)
    dx, dy = x - sensor.x_m, y - sensor.y_m
    return cos * dx + sin * dy, cos * dy - sin * dx
