"""What stands around the robot, by the geometry of the recorded world.

Distances are from the middle of the robot, where its LiDAR sits unless the scenario says
otherwise. A moving box counts as the circle around it, for the recording holds no more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from grader.recording.model import NS, Scene, Truth
from sim.shapes import Capsule, point_clearance_m

_PLACES_PER_S = 10


@dataclass(frozen=True)
class Sight:
    """Something as seen from the robot.

    Attributes:
        name: Such as ``boxes[2]``.
        distance_m: From the robot's middle to its outline.
        bearing_rad: In the robot's frame, counter-clockwise from straight ahead.
    """

    name: str
    distance_m: float
    bearing_rad: float = 0.0


def ahead(scene: Scene, step: Truth) -> Sight | None:
    """The nearest thing straight ahead of the robot, or None where there is nothing."""
    cos, sin = math.cos(step.yaw_rad), math.sin(step.yaw_rad)
    found: Sight | None = None
    for name, capsules in _things(scene, step.time_ns):
        for x1, y1, x2, y2, radius in capsules:
            # In the robot's frame the ray is the positive x axis.
            dx1, dy1, dx2, dy2 = x1 - step.x_m, y1 - step.y_m, x2 - step.x_m, y2 - step.y_m
            distance_m = _ray_m(
                (
                    cos * dx1 + sin * dy1,
                    cos * dy1 - sin * dx1,
                    cos * dx2 + sin * dy2,
                    cos * dy2 - sin * dx2,
                    radius,
                )
            )
            if distance_m is not None and (found is None or distance_m < found.distance_m):
                found = Sight(name, distance_m)
    return found


def nearest(scene: Scene, step: Truth) -> Sight | None:
    """The nearest thing in any direction, or None in an empty world."""
    found: Sight | None = None
    for name, capsules in _things(scene, step.time_ns):
        for capsule in capsules:
            distance_m = abs(point_clearance_m(step.x_m, step.y_m, capsule))
            if found is None or distance_m < found.distance_m:
                x, y = _foot(step.x_m, step.y_m, capsule)
                bearing_rad = math.atan2(y - step.y_m, x - step.x_m) - step.yaw_rad
                found = Sight(name, distance_m, math.remainder(bearing_rad, math.tau))
    return found


def _things(scene: Scene, time_ns: int) -> Iterator[tuple[str, tuple[Capsule, ...]]]:
    yield from scene.outlines.items()
    for name, (radius_m, places) in scene.moving.items():
        place = _place(places, (time_ns - scene.began_ns) * _PLACES_PER_S / NS)
        if place is not None:
            yield name, ((*place, *place, radius_m),)


def _place(
    places: tuple[tuple[float, float, float] | None, ...], position: float
) -> tuple[float, float] | None:
    """Where something is between two of its places; there only if it is there at both."""
    if not places:
        return None
    index = min(max(int(position), 0), len(places) - 1)
    before, after = places[index], places[min(index + 1, len(places) - 1)]
    if before is None or after is None:
        return None if before is None else before[:2]
    share = min(max(position - index, 0.0), 1.0)
    return before[0] + share * (after[0] - before[0]), before[1] + share * (after[1] - before[1])


def _ray_m(capsule: Capsule) -> float | None:
    """Distance along the positive x axis to a capsule's outline, or None if it misses."""
    x1, y1, x2, y2, radius = capsule
    if radius == 0.0:
        return _ray_segment_m(x1, y1, x2, y2)
    hits = [_ray_circle_m(x1, y1, radius)]
    length_m = math.hypot(x2 - x1, y2 - y1)
    if length_m > 0.0:
        hits.append(_ray_circle_m(x2, y2, radius))
        nx, ny = (y1 - y2) / length_m * radius, (x2 - x1) / length_m * radius
        hits += [
            _ray_segment_m(x1 + side * nx, y1 + side * ny, x2 + side * nx, y2 + side * ny)
            for side in (1.0, -1.0)
        ]
    return min((hit for hit in hits if hit is not None), default=None)


def _ray_segment_m(x1: float, y1: float, x2: float, y2: float) -> float | None:
    if y1 * y2 > 0.0:
        return None
    if y1 == y2:
        # Seen along its length a wall has no width: the nearer end counts.
        return min((x for x in (x1, x2) if x >= 0.0), default=None)
    x = x1 + (x2 - x1) * y1 / (y1 - y2)
    return x if x >= 0.0 else None


def _ray_circle_m(x: float, y: float, radius: float) -> float | None:
    if abs(y) > radius:
        return None
    half = math.sqrt(radius * radius - y * y)
    return next((hit for hit in (x - half, x + half) if hit >= 0.0), None)


def _foot(px: float, py: float, capsule: Capsule) -> tuple[float, float]:
    """The point on a capsule's middle line that is nearest to a point."""
    x1, y1, x2, y2, _ = capsule
    ex, ey = x2 - x1, y2 - y1
    square = ex * ex + ey * ey
    along = 0.0 if square == 0.0 else ((px - x1) * ex + (py - y1) * ey) / square
    along = min(max(along, 0.0), 1.0)
    return x1 + along * ex, y1 + along * ey
