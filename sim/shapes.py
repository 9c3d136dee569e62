"""Shapes that stand in a world or move in it.

Everything is made of *capsules*: all points within ``radius`` of a line segment. A wall is a
capsule of radius zero, a circle is a capsule whose segment is a point. So one distance
formula serves contact with any shape.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from operator import attrgetter

from sim.colour import Rgb
from sim.motion import Pose, wrap_angle

Capsule = tuple[float, float, float, float, float]
"""x1, y1, x2, y2, radius in metres."""

MAX_SPEED_M_S = 5.0
"""Fastest obstacle. Contact with it is looked for at every step of 10 ms: at 5 m/s it moves
5 cm in one, less than half of any robot, so that it cannot jump over one."""


ROBOTS = "robots"
HEIGHT_M = 0.5
"""How high things are for a camera, unless the YAML says so: higher than any robot."""
PAINT: Rgb = (150, 150, 150)
"""Their colour, unless the YAML says so."""
ROBOT_HEIGHT_M = 0.19
"""How high the other robots are for a camera: about a Burger."""
ROBOT_PAINT: Rgb = (70, 70, 70)

_WORDS = {
    "bounds": "the wall around the world",
    "segments": "a wall",
    "boxes": "a box",
    "circles": "a pillar",
    "polygons": "an obstacle",
    "moving": "a moving obstacle",
}


def obstacle_words(label: str) -> str:
    """What stands under a label of a world file, in words: ``segments[0]`` is a wall."""
    kind, _, name = label.rstrip("]").partition("[")
    return f"the robot {name}" if kind == ROBOTS else _WORDS.get(kind, "something")


@dataclass(frozen=True, slots=True)
class Shape:
    """A shape in the frame it is given in.

    Attributes:
        label: Where it is in the YAML, such as ``boxes[2]``.
        line: Its line in the file, or None for a shape that was not read from one.
        corners: Corners of the area that it fills, in order; empty for a wall without an
            inside and for a circle.
        height_m: As a camera sees it; for a robot and a LiDAR everything is high enough.
        colour: As a camera sees it.
    """

    label: str
    capsules: tuple[Capsule, ...]
    line: int | None = None
    corners: tuple[tuple[float, float], ...] = ()
    height_m: float = HEIGHT_M
    colour: Rgb = PAINT

    def clearance_m(self, x_m: float, y_m: float) -> float:
        """Distance from a point to the shape, negative inside it."""
        nearest_m = min(point_clearance_m(x_m, y_m, capsule) for capsule in self.capsules)
        return -abs(nearest_m) if self.contains(x_m, y_m) else nearest_m

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether a point is inside the area that the shape fills (even-odd rule)."""
        inside = False
        for (ax, ay), (bx, by) in zip(
            self.corners, self.corners[1:] + self.corners[:1], strict=True
        ):
            if (ay > y_m) != (by > y_m) and x_m < ax + (y_m - ay) * (bx - ax) / (by - ay):
                inside = not inside
        return inside


def wall(label: str, x1: float, y1: float, x2: float, y2: float, line: int | None = None) -> Shape:
    """A straight wall without thickness."""
    return Shape(label, ((x1, y1, x2, y2, 0.0),), line)


def circle(label: str, x_m: float, y_m: float, radius_m: float, line: int | None = None) -> Shape:
    """A round pillar."""
    return Shape(label, ((x_m, y_m, x_m, y_m, radius_m),), line)


def polygon(label: str, corners: tuple[tuple[float, float], ...], line: int | None = None) -> Shape:
    """A filled polygon; the last corner is joined to the first."""
    edges = zip(corners, corners[1:] + corners[:1], strict=True)
    capsules = tuple((ax, ay, bx, by, 0.0) for (ax, ay), (bx, by) in edges)
    return Shape(label, capsules, line, corners)


def box(label: str, pose: Pose, size_m: tuple[float, float], line: int | None = None) -> Shape:
    """A filled rectangle."""
    half_x, half_y = 0.5 * size_m[0], 0.5 * size_m[1]
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    corners = tuple(
        (pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y)
        for x, y in ((half_x, half_y), (-half_x, half_y), (-half_x, -half_y), (half_x, -half_y))
    )
    return polygon(label, corners, line)


@dataclass(slots=True)
class Body:
    """The footprint of a robot, which the others see and touch; it moves as the robot does."""

    name: str
    pose: Pose
    radius_m: float

    @property
    def shape(self) -> Shape:
        """Where it is now."""
        shape = circle(f"{ROBOTS}[{self.name}]", self.pose.x_m, self.pose.y_m, self.radius_m)
        return replace(shape, height_m=ROBOT_HEIGHT_M, colour=ROBOT_PAINT)


@dataclass(frozen=True, slots=True)
class FloorLine:
    """A line on the floor: only cameras see it."""

    points: tuple[tuple[float, float], ...]
    width_m: float
    colour: Rgb


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
        height_m: As a camera sees it.
        colour: As a camera sees it.
    """

    label: str
    path: tuple[Waypoint, ...]
    radius_m: float | None = None
    size_m: tuple[float, float] | None = None
    appears_ns: int = 0
    disappears_ns: int | None = None
    repeat: bool = False
    line: int | None = None
    height_m: float = HEIGHT_M
    colour: Rgb = PAINT

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
        index = bisect_right(path, time_ns, key=attrgetter("at_ns"))
        before, after = path[index - 1 : index + 1]
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
            shape = circle(self.label, pose.x_m, pose.y_m, self.radius_m, self.line)
        else:
            shape = box(self.label, pose, self.size_m or (0.0, 0.0), self.line)
        return replace(shape, height_m=self.height_m, colour=self.colour)


def point_clearance_m(x_m: float, y_m: float, capsule: Capsule) -> float:
    """Distance from a point to a capsule; negative inside it."""
    x1, y1, x2, y2, radius = capsule
    return _point_segment_m(x_m, y_m, x1, y1, x2, y2) - radius


def chord_clearance_m(ax: float, ay: float, bx: float, by: float, capsule: Capsule) -> float:
    """Least distance from any point of the segment a-b to a capsule; negative inside it."""
    x1, y1, x2, y2, radius = capsule
    if x1 == x2 and y1 == y2:
        return _point_segment_m(x1, y1, ax, ay, bx, by) - radius
    side_a = (x2 - x1) * (ay - y1) - (y2 - y1) * (ax - x1)
    side_b = (x2 - x1) * (by - y1) - (y2 - y1) * (bx - x1)
    if side_a * side_b < 0.0:
        side_1 = (bx - ax) * (y1 - ay) - (by - ay) * (x1 - ax)
        side_2 = (bx - ax) * (y2 - ay) - (by - ay) * (x2 - ax)
        if side_1 * side_2 < 0.0:
            return -radius
    # Two segments that do not cross are nearest at an end of one of them.
    return (
        min(
            _point_segment_m(ax, ay, x1, y1, x2, y2),
            _point_segment_m(bx, by, x1, y1, x2, y2),
            _point_segment_m(x1, y1, ax, ay, bx, by),
            _point_segment_m(x2, y2, ax, ay, bx, by),
        )
        - radius
    )


def _point_segment_m(px: float, py: float, x1: float, y1: float, x2: float, y2: float) -> float:
    ex, ey, qx, qy = x2 - x1, y2 - y1, px - x1, py - y1
    square = ex * ex + ey * ey
    if square > 0.0:
        along = (qx * ex + qy * ey) / square
        if along >= 1.0:
            return math.hypot(px - x2, py - y2)
        if along > 0.0:
            # The cross product keeps its precision where subtracting the foot would not.
            return abs(ex * qy - ey * qx) / math.sqrt(square)
    return math.hypot(qx, qy)
