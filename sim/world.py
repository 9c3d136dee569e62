"""Worlds: YAML in, an immutable :class:`World` out.

The frame is fixed, x and y in metres, yaw counter-clockwise (REP-103). A world looks like::

    bounds: [-2, -2, 2, 2]                     # a wall all around: x_min, y_min, x_max, y_max
    start: [0, 0, 90 deg]                      # where the robot starts by default
    values: {wall_x: 1.5}                      # the value of $wall_x by default
    segments:
      - [$wall_x, -1, $wall_x, 1]              # x1, y1, x2, y2
    boxes:
      - {centre: [0, 1.5], size: [50 cm, 20 cm], yaw: 30 deg}
    circles:
      - {centre: [-1, 1], radius: 10 cm}
    polygons:
      - {points: [[-1, -1], [-1.5, -1], [-1.2, -1.4]]}
    moving:
      - circle: {radius: 0.2}
        path:
          - {at: 0 s, pose: [1, -1]}
          - {at: 4 s, pose: [1, 1]}
        appears: 2 s
    lines:                                     # on the floor, for cameras
      - {points: [[0, 0], [1, 0], [1, 1]], width: 5 cm, colour: black}
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from grader.errors import AssignmentError, Problem
from grader.spec.document import Place
from grader.spec.nearest_name import did_you_mean
from grader.spec.source import Source, in_order, parse_source, read_source
from sim.colour import Rgb
from sim.motion import ORIGIN, Pose
from sim.shapes import Body, FloorLine, MovingObstacle, Shape, polygon, wall
from sim.turtles.bounds import SIZE_M
from sim.world_model import WorldModel

MAX_SEGMENTS = 3_000
MAX_MOVING = 100

Values = Mapping[str, int | float | str]
"""What to write in place of ``$name``: a number, or a text such as ``20 cm``."""


@dataclass(frozen=True)
class World:
    """Everything that the robot can see and touch.

    Attributes:
        bounds: x_min, y_min, x_max, y_max of the wall around it, or None for an open world.
            Its four walls are among the shapes.
        bodies: Other robots in it.
        turtles: Names and poses of the turtles that are there instead of a robot.
        lines: On the floor, for cameras.
        floor: Its colour.
        light: Brightness of everything for cameras.
        text: The file, with the values in place of every ``$name``: what reads as the same world.
    """

    shapes: tuple[Shape, ...] = ()
    moving: tuple[MovingObstacle, ...] = ()
    bounds: tuple[float, float, float, float] | None = None
    start: Pose = ORIGIN
    file: Path = Path("world.yaml")
    bodies: tuple[Body, ...] = ()
    turtles: tuple[tuple[str, Pose], ...] = ()
    lines: tuple[FloorLine, ...] = ()
    floor: Rgb = (205, 205, 205)
    light: float = 1.0
    text: str = field(default="{}", compare=False, repr=False)

    def extent(self, *points: tuple[float, float]) -> tuple[float, float, float, float]:
        """The smallest upright rectangle around everything, as x_min, y_min, x_max, y_max."""
        xs, ys = [x for x, _ in points], [y for _, y in points]
        for shape in self.shapes:
            for x1, y1, x2, y2, radius in shape.capsules:
                xs += (min(x1, x2) - radius, max(x1, x2) + radius)
                ys += (min(y1, y2) - radius, max(y1, y2) + radius)
        for obstacle in self.moving:
            for waypoint in obstacle.path:
                xs += (waypoint.pose.x_m - obstacle.reach_m, waypoint.pose.x_m + obstacle.reach_m)
                ys += (waypoint.pose.y_m - obstacle.reach_m, waypoint.pose.y_m + obstacle.reach_m)
        if not xs:
            return (0.0, 0.0, 0.0, 0.0)
        return (min(xs), min(ys), max(xs), max(ys))

    def moving_at(self, time_ns: int) -> list[Shape]:
        """What moves and is there at a simulated time, each where it is then; robots as of now."""
        poses = ((obstacle, obstacle.pose_at(time_ns)) for obstacle in self.moving)
        found = [obstacle.shape_at(pose) for obstacle, pose in poses if pose is not None]
        return [*found, *(body.shape for body in self.bodies)]

    def obstruction(self, pose: Pose, radius_m: float) -> Problem | None:
        """The shape that keeps a circular robot from a pose at simulated time 0, or None."""
        place = f"a robot with radius {radius_m:g} m cannot be at ({pose.x_m:g}, {pose.y_m:g})"
        for shape in (*self.shapes, *self.moving_at(0)):
            if shape.label == "bounds" and self.bounds is not None:
                x_min, y_min, x_max, y_max = self.bounds
                if not (x_min < pose.x_m < x_max and y_min < pose.y_m < y_max):
                    return Problem(f"{place}: that is outside the bounds", shape.line, "bounds")
            clearance_m = shape.clearance_m(pose.x_m, pose.y_m)
            if clearance_m <= radius_m:
                way = "this is there" if clearance_m <= 0.0 else f"this is {clearance_m:.3g} m away"
                return Problem(f"{place}: {way}", shape.line, shape.label)
        return None

    def check_start(self, pose: Pose, radius_m: float) -> None:
        """Refuse a robot that would start inside a wall."""
        problem = self.obstruction(pose, radius_m)
        if problem is not None:
            raise AssignmentError(self.file, [problem])


def read_world(file: Path, values: Values | None = None) -> World:
    """Read a world file."""
    return world_of(read_source(file), values or {})


def parse_world(text: str, file: Path = Path("world.yaml"), values: Values | None = None) -> World:
    """Read a world from text; ``file`` is only named in errors."""
    return world_of(parse_source(text, file), values or {})


def world_of(source: Source, values: Values) -> World:
    """A world from what its file says, with values in place of every ``$name``."""
    source = _with_values(source, values)
    model = source.read(WorldModel)
    shapes = _shapes(model, source)
    walls = sum(len(shape.capsules) for shape in shapes)
    problems: list[Problem] = []
    if walls > MAX_SEGMENTS:
        problems.append(Problem(f"{walls} walls and circles: at most {MAX_SEGMENTS} are simulated"))
    if len(model.moving) > MAX_MOVING:
        text = f"{len(model.moving)} moving obstacles: at most {MAX_MOVING} are simulated"
        problems.append(source.problem(("moving",), text))
    problems += _turtle_problems(model, source)
    if problems:
        raise AssignmentError(source.file, in_order(problems))
    moving = tuple(
        item.obstacle(f"moving[{i}]", source.line(("moving", i)))
        for i, item in enumerate(model.moving)
    )
    return World(
        shapes,
        moving,
        model.bounds,
        model.start,
        source.file,
        turtles=tuple((one.name, one.pose) for one in model.turtles),
        lines=tuple(item.line for item in model.lines),
        floor=model.floor,
        light=model.light,
        text=json.dumps(source.data),
    )


def turtle_names(source: Source) -> tuple[str, ...]:
    """Names of the turtles in a world file, which may have any mistakes."""
    found = source.data.get("turtles")
    entries = found if isinstance(found, list) else ()
    names = (entry.get("name") for entry in entries if isinstance(entry, dict))
    return tuple(name for name in names if isinstance(name, str))


def _turtle_problems(model: WorldModel, source: Source) -> Iterator[Problem]:
    """What does not fit to turtles: a robot's world, a place beyond the walls, two of one name."""
    if not model.turtles:
        return
    for key in source.data.keys() - {"turtles", "values"}:
        text = f"a world has turtles or a robot, not both: leave {key!r} or 'turtles' out"
        yield source.problem((key,), text)
    yield from source.duplicates("name", "turtles")
    for index, one in enumerate(model.turtles):
        if not (0.0 <= one.pose.x_m <= SIZE_M and 0.0 <= one.pose.y_m <= SIZE_M):
            text = (
                f"{one.name} cannot be at ({one.pose.x_m:g}, {one.pose.y_m:g}): the walls of "
                f"turtles are at 0 and {SIZE_M:.4g} m"
            )
            yield source.problem(("turtles", index, "pose"), text)


def _shapes(model: WorldModel, source: Source) -> tuple[Shape, ...]:
    found: list[Shape] = []
    if model.bounds is not None:
        x_min, y_min, x_max, y_max = model.bounds
        corners = ((x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max))
        # Unlike a polygon it is filled outside, so that it has no corners of its own.
        outline = polygon("bounds", corners, source.line(("bounds",)))
        found.append(replace(outline, corners=()))
    for i, ends in enumerate(model.segments):
        found.append(wall(f"segments[{i}]", *ends, source.line(("segments", i))))
    boxes, circles, polygons = model.boxes, model.circles, model.polygons
    areas: dict[str, Any] = {"boxes": boxes, "circles": circles, "polygons": polygons}
    for key, items in areas.items():
        for i, item in enumerate(items):
            found.append(item.shape(f"{key}[{i}]", source.line((key, i))))
    return tuple(found)


def _with_values(source: Source, given: Values) -> Source:
    """Write values in place of every ``$name``."""
    declared = source.data.get("values")
    names: dict[str, Any] = dict(declared) if isinstance(declared, dict) else {}
    problems = [
        Problem(f"there is no value {name!r} in this world.{did_you_mean(name, names)}")
        for name in given
        if name not in names
    ]
    names.update(given)

    def fill(value: Any, place: Place) -> Any:
        if isinstance(value, dict):
            return {key: fill(item, (*place, key)) for key, item in value.items()}
        if isinstance(value, list):
            return [fill(item, (*place, i)) for i, item in enumerate(value)]
        if isinstance(value, str) and value.startswith("$"):
            name = value[1:]
            if name in names:
                return names[name]
            text = f"{value!r} is not among the 'values' of this world."
            problems.append(source.problem(place, text + did_you_mean(name, names)))
        return value

    data = {
        key: value if key == "values" else fill(value, (key,)) for key, value in source.data.items()
    }
    if problems:
        raise AssignmentError(source.file, problems)
    return replace(source, data=data)
