"""What turtles drew: the lines on the canvas, and how far they are from a figure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
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
# Where a line turns by less it goes straight on: no corner begins there.
_LEAST_TURN_RAD = math.radians(2.0)
_STRAIGHT_RAD = 1e-9
# A step of the turtles lasts 16 ms: what comes later than this does not follow on the last one.
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


@dataclass(frozen=True)
class _Pen:
    colour: Colour = (0, 0, 0)
    width: int = 0
    is_down: bool = False


@dataclass
class _Turtle:
    """A turtle that draws: where it is, its pen, and the line that it has begun."""

    name: str
    place: Point | None
    time_ns: int
    pen: _Pen = _Pen()
    points: list[Point] = field(default_factory=list)
    times_ns: list[int] = field(default_factory=list)

    def go(self, to: Point, time_ns: int) -> None:
        """Draw on to a point."""
        if time_ns - self.time_ns > _GAP_NS:
            # Here a window begins, and the way before it is not known.
            self.place = None
        self.time_ns = time_ns
        if self.place is not None and self.place != to and self.pen.is_down:
            if not self.points:
                self.points, self.times_ns = [self.place], [time_ns]
            if len(self.points) > 1 and _is_straight(self.points[-2], self.points[-1], to):
                del self.points[-1], self.times_ns[-1]
            self.points.append(to)
            self.times_ns.append(time_ns)
        self.place = to

    def finished(self, *, is_jump: bool = False) -> list[Line]:
        """Lift the pen: the line that it has drawn, or none."""
        points, times_ns = tuple(self.points), tuple(self.times_ns)
        self.points, self.times_ns = [], []
        if not points:
            return []
        return [Line(self.name, self.pen.colour, self.pen.width, points, times_ns, is_jump)]


def _is_straight(first: Point, second: Point, third: Point) -> bool:
    """Whether a line goes on in its direction."""
    (ax, ay), (bx, by), (cx, cy) = first, second, third
    ux, uy, vx, vy = bx - ax, by - ay, cx - bx, cy - by
    cross, along = ux * vy - uy * vx, ux * vx + uy * vy
    return along > 0.0 and abs(cross) <= _STRAIGHT_RAD * along


def drawn(recording: Recording) -> tuple[Line, ...]:
    """The lines on the canvas at the end, in the order in which they were begun."""
    lines: list[Line] = []
    turtles: dict[str, _Turtle] = {}
    for item in _in_order(recording):
        if isinstance(item, Truth):
            if item.robot in turtles:
                turtles[item.robot].go((item.x_m, item.y_m), item.time_ns)
        elif item.kind in ("cleared", "reset"):
            lines.clear()
            for turtle in turtles.values():
                turtle.finished()
            if item.kind == "reset":
                turtles.clear()
        elif item.turtle:
            lines += _lines_ended_by(item, turtles)
    for turtle in turtles.values():
        lines += turtle.finished()
    return tuple(sorted(lines, key=lambda line: line.times_ns[0]))


def _lines_ended_by(event: TurtleEvent, turtles: dict[str, _Turtle]) -> list[Line]:
    """Let an event happen to its turtle."""
    place = (event.x_m, event.y_m)
    if event.turtle not in turtles or event.kind in ("placed", "spawned"):
        turtles[event.turtle] = _Turtle(event.turtle, place, event.time_ns)
    turtle = turtles[event.turtle]
    lines = turtle.finished()
    if event.kind == "teleported":
        turtle.go(place, event.time_ns)
        lines += turtle.finished(is_jump=True)
    elif event.kind == "killed":
        del turtles[event.turtle]
    turtle.pen = _Pen(event.colour, event.width, event.is_down)
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
    found: list[Corner] = []
    bend: list[Corner] = []
    for turn in _turns(_way(lines, closed_m)):
        if bend and math.dist(bend[0].place, turn.place) > CORNER_M:
            found += _corner(bend)
            bend = []
        if bend or abs(turn.angle_rad) > _LEAST_TURN_RAD:
            bend.append(turn)
    return found + _corner(bend)


def _way(lines: Sequence[Line], closed_m: float) -> list[tuple[Point, int]]:
    """The points of all lines in order, with their times; a closed way begins again at its end."""
    way: list[tuple[Point, int]] = []
    for line in lines:
        for point, time_ns in zip(line.points, line.times_ns, strict=True):
            if not way or math.dist(way[-1][0], point) > SAMPLE_M:
                way.append((point, time_ns))
    if len(way) < 3 or math.dist(way[0][0], way[-1][0]) >= closed_m:
        return way
    # The end that is not quite at the beginning would make a corner of its own.
    while len(way) > 3 and math.dist(way[0][0], way[-1][0]) < closed_m:
        del way[-1]
    return way + way[:2]


def _turns(way: Sequence[tuple[Point, int]]) -> Iterator[Corner]:
    """How far the way turns at each of its points."""
    for (before, _), (place, time_ns), (after, _) in zip(way, way[1:], way[2:], strict=False):
        angle_rad = math.remainder(
            _bearing_rad(place, after) - _bearing_rad(before, place), math.tau
        )
        yield Corner(place, angle_rad, time_ns)


def _bearing_rad(begin: Point, end: Point) -> float:
    return math.atan2(end[1] - begin[1], end[0] - begin[0])


def _corner(bend: Sequence[Corner]) -> list[Corner]:
    """The corner that the turns of a bend make together, where it turns the most; or none."""
    angle_rad = sum(turn.angle_rad for turn in bend)
    if abs(angle_rad) < _LEAST_CORNER_RAD:
        return []
    sharpest = max(bend, key=lambda turn: abs(turn.angle_rad))
    return [replace(sharpest, angle_rad=angle_rad)]
