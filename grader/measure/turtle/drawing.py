"""What turtles drew: the lines on the canvas, and how far they are from a figure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth, TurtleEvent

Point = tuple[float, float]
Colour = tuple[int, int, int]

SAMPLE_M = 0.02
"""Lines and figures are compared at points so far apart."""
CORNER_M = 0.1
"""A turn within so little way is one corner."""
_LEAST_CORNER_RAD = math.radians(25.0)
_STRAIGHT_RAD = 1e-9
_GAP_NS = NS // 10


@dataclass(frozen=True)
class Line:
    """A line that a turtle drew without lifting its pen or taking another.

    Attributes:
        points: From its beginning to its end, in metres; only where it turns.
        times_ns: When the turtle was at each point.
        is_jump: Whether a teleport drew it.
    """

    turtle: str
    colour: Colour
    width: int
    points: tuple[Point, ...]
    times_ns: tuple[int, ...]
    is_jump: bool = False

    @property
    def length_m(self) -> float:
        """How long it is."""
        return sum(math.dist(a, b) for a, b in pairwise(self.points))


@dataclass
class _Pencil:
    """A turtle that draws: where it is, its pen, and the line that it has begun."""

    turtle: str
    at: Point | None
    time_ns: int
    pen: tuple[Colour, int, bool] = ((0, 0, 0), 0, False)
    points: list[Point] = field(default_factory=list)
    times_ns: list[int] = field(default_factory=list)

    def go(self, to: Point, time_ns: int) -> None:
        """Draw on to a point; before a window begins its way is not known."""
        if time_ns - self.time_ns > _GAP_NS:
            self.at = None
        self.time_ns = time_ns
        if self.at is not None and self.at != to and self.pen[2]:
            if not self.points:
                self.points, self.times_ns = [self.at], [time_ns]
            if len(self.points) > 1 and _is_straight(self.points[-2], self.points[-1], to):
                del self.points[-1], self.times_ns[-1]
            self.points.append(to)
            self.times_ns.append(time_ns)
        self.at = to

    def end(self, *, is_jump: bool = False) -> Iterable[Line]:
        """Lift it; the line that it has drawn, if any."""
        if self.points:
            colour, width, _ = self.pen
            points, times_ns = tuple(self.points), tuple(self.times_ns)
            self.points, self.times_ns = [], []
            yield Line(self.turtle, colour, width, points, times_ns, is_jump)


def _is_straight(first: Point, second: Point, third: Point) -> bool:
    """Whether a line goes on in its direction."""
    (ax, ay), (bx, by), (cx, cy) = first, second, third
    ux, uy, vx, vy = bx - ax, by - ay, cx - bx, cy - by
    cross, along = ux * vy - uy * vx, ux * vx + uy * vy
    return along > 0.0 and abs(cross) <= _STRAIGHT_RAD * along


def drawn(recording: Recording) -> tuple[Line, ...]:
    """The lines on the canvas at the end, in the order in which they were begun."""
    lines: list[Line] = []
    pencils: dict[str, _Pencil] = {}
    for item in _in_order(recording):
        if isinstance(item, Truth):
            if (pencil := pencils.get(item.robot)) is not None:
                pencil.go((item.x_m, item.y_m), item.time_ns)
        elif item.kind in ("cleared", "reset"):
            for pencil in pencils.values():
                _ = [*pencil.end()]
            lines.clear()
            if item.kind == "reset":
                pencils.clear()
        elif item.turtle:
            lines += _happened(item, pencils)
    for pencil in pencils.values():
        lines += pencil.end()
    return tuple(sorted(lines, key=lambda line: line.times_ns[0]))


def _happened(event: TurtleEvent, pencils: dict[str, _Pencil]) -> list[Line]:
    """What an event does to a turtle that draws; the lines that it ends."""
    place, pencil = (event.x_m, event.y_m), pencils.get(event.turtle)
    if pencil is None or event.kind in ("placed", "spawned"):
        pencil = pencils[event.turtle] = _Pencil(event.turtle, place, event.time_ns)
    lines = [*pencil.end()]
    if event.kind == "teleported":
        pencil.go(place, event.time_ns)
        lines += pencil.end(is_jump=True)
    elif event.kind == "killed":
        del pencils[event.turtle]
    pencil.pen = (event.colour, event.width, event.is_down)
    return lines


def _in_order(recording: Recording) -> list[Truth | TurtleEvent]:
    """Truth and events by time; what happened in a step comes before its motion."""
    found: list[Truth | TurtleEvent] = [*recording.turtles, *recording.truth]
    return sorted(found, key=lambda item: (item.time_ns, isinstance(item, Truth)))


def sampled(points: Sequence[Point]) -> list[Point]:
    """Points along a line, :data:`SAMPLE_M` apart."""
    found = [points[0]]
    for (ax, ay), (bx, by) in pairwise(points):
        number = max(1, math.ceil(math.dist((ax, ay), (bx, by)) / SAMPLE_M))
        steps = (one / number for one in range(1, number + 1))
        found += [(ax + share * (bx - ax), ay + share * (by - ay)) for share in steps]
    return found


def distances_m(places: Sequence[Point], lines: Sequence[Sequence[Point]]) -> list[float]:
    """How far each place is from the nearest of some lines."""
    # Many times many: without numpy it takes a second.
    import numpy as np

    starts = np.array([a for line in lines for a, _ in pairwise(line)])
    ends = np.array([b for line in lines for _, b in pairwise(line)])
    ways = ends - starts
    squares = np.maximum((ways**2).sum(axis=1), 1e-18)
    found = []
    for place in np.asarray(places, dtype=float):
        away = place - starts
        share = np.clip((away * ways).sum(axis=1) / squares, 0.0, 1.0)
        off = away - share[:, None] * ways
        found.append(float(np.sqrt((off**2).sum(axis=1).min())))
    return found


@dataclass(frozen=True)
class Corner:
    """A corner of a drawing; ``angle_rad`` is how far the line turns, to the left positive."""

    place: Point
    angle_rad: float
    time_ns: int


def corners(lines: Sequence[Line], closed_m: float) -> list[Corner]:
    """The corners of what a turtle drew.

    Args:
        closed_m: A drawing whose ends are so near each other has a corner there too.
    """
    way: list[tuple[Point, int]] = []
    for line in lines:
        for point, time_ns in zip(line.points, line.times_ns, strict=True):
            if not way or math.dist(way[-1][0], point) > SAMPLE_M:
                way.append((point, time_ns))
    if len(way) < 3:
        return []
    if math.dist(way[0][0], way[-1][0]) < closed_m:
        # The end that is not quite at the beginning would make a corner of its own.
        while len(way) > 3 and math.dist(way[0][0], way[-1][0]) < closed_m:
            del way[-1]
        way += way[:2]
    turns = [
        (_turn_rad(a[0], b[0], c[0]), b) for a, b, c in zip(way, way[1:], way[2:], strict=False)
    ]
    found: list[Corner] = []
    group: list[tuple[float, tuple[Point, int]]] = []
    for turn in turns:
        if group and math.dist(group[0][1][0], turn[1][0]) > CORNER_M:
            found += _corner(group)
            group = []
        if group or abs(turn[0]) > math.radians(2.0):
            group.append(turn)
    return [*found, *_corner(group)]


def _corner(group: Sequence[tuple[float, tuple[Point, int]]]) -> list[Corner]:
    angle_rad = sum(turn for turn, _ in group)
    if abs(angle_rad) < _LEAST_CORNER_RAD:
        return []
    place, time_ns = max(group, key=lambda one: abs(one[0]))[1]
    return [Corner(place, angle_rad, time_ns)]


def _turn_rad(a: Point, b: Point, c: Point) -> float:
    first, second = math.atan2(b[1] - a[1], b[0] - a[0]), math.atan2(c[1] - b[1], c[0] - b[0])
    return math.remainder(second - first, math.tau)
