"""What stands around the robot, by the geometry of the recorded world.

Distances are from the LiDAR, which sits in the middle of the robot unless the scenario says
otherwise. Straight ahead is where the robot drives, however the LiDAR is turned.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from grader.recording.simulated import Scene, Truth
from sim.motion import Pose, compose
from sim.shapes import Capsule, obstacle_words, point_clearance_m


@dataclass(frozen=True)
class Sight:
    """Something such as ``boxes[2]``, with its bearing from straight ahead."""

    name: str
    distance_m: float
    bearing_rad: float = 0.0


def ahead(scene: Scene | None, step: Truth) -> Sight | None:
    """The nearest thing straight ahead of the robot, or None where there is nothing."""
    if scene is None:
        return None
    eye = _eye(scene, step)
    cos, sin = math.cos(step.yaw_rad), math.sin(step.yaw_rad)

    def into_frame(x_m: float, y_m: float) -> tuple[float, float]:
        """As seen from the LiDAR, with the robot's heading as the x axis."""
        dx, dy = x_m - eye.x_m, y_m - eye.y_m
        return cos * dx + sin * dy, cos * dy - sin * dx

    found: Sight | None = None
    for label, (x1, y1, x2, y2, radius) in _things(scene, step.time_ns):
        begin = into_frame(x1, y1)
        distance_m = (
            _ray_circle_m(*begin, radius) if radius else _ray_wall_m(*begin, *into_frame(x2, y2))
        )
        if distance_m is not None and (found is None or distance_m < found.distance_m):
            found = Sight(obstacle_words(label), distance_m)
    return found


def nearest(scene: Scene, step: Truth) -> Sight | None:
    """The nearest thing in any direction, or None in an empty world."""
    eye = _eye(scene, step)
    found: Sight | None = None
    for label, capsule in _things(scene, step.time_ns):
        distance_m = abs(point_clearance_m(eye.x_m, eye.y_m, capsule))
        if found is None or distance_m < found.distance_m:
            x, y = _foot(eye.x_m, eye.y_m, capsule)
            bearing_rad = math.atan2(y - eye.y_m, x - eye.x_m) - step.yaw_rad
            found = Sight(obstacle_words(label), distance_m, math.remainder(bearing_rad, math.tau))
    return found


def ahead_m(scene: Scene, step: Truth) -> float | None:
    """How far the nearest thing straight ahead is, or None where there is nothing."""
    sight = ahead(scene, step)
    return None if sight is None else sight.distance_m


def nearest_m(scene: Scene, step: Truth) -> float | None:
    """How far the nearest thing in any direction is, or None in an empty world."""
    sight = nearest(scene, step)
    return None if sight is None else sight.distance_m


def _eye(scene: Scene, step: Truth) -> Pose:
    """Where the LiDAR is."""
    return compose(Pose(step.x_m, step.y_m, step.yaw_rad), scene.lidar)


def _things(scene: Scene, time_ns: int) -> Iterator[tuple[str, Capsule]]:
    """Walls, which have no radius, and circles, whose segment is a point."""
    for label, capsules in scene.outlines.items():
        yield from ((label, capsule) for capsule in capsules)
    for obstacle in scene.moving:
        pose = obstacle.pose_at(time_ns - scene.began_ns)
        if pose is not None:
            yield from ((obstacle.label, item) for item in obstacle.shape_at(pose).capsules)


def _ray_wall_m(x1: float, y1: float, x2: float, y2: float) -> float | None:
    """Distance along the positive x axis, or None if it misses."""
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
