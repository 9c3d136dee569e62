"""Worlds: YAML in, an immutable :class:`World` out.

The frame is fixed, x and y in metres, yaw counter-clockwise (REP-103). A world looks like::

    bounds: [-2, -2, 2, 2]                     # a wall all around: x_min, y_min, x_max, y_max
    start: [0, 0, 90 deg]                      # where the robot starts if nobody says else
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
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from grader.errors import AssignmentError, Problem
from grader.spec.document import Place
from grader.spec.nearest_name import did_you_mean
from grader.spec.source import Source, parse_source, read_source
from sim.coordinates import MIN_SIZE_M
from sim.motion import ORIGIN, Pose
from sim.script import MovingObstacle
from sim.shapes import Shape, box, circle, polygon, wall
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
    """

    shapes: tuple[Shape, ...] = ()
    moving: tuple[MovingObstacle, ...] = ()
    bounds: tuple[float, float, float, float] | None = None
    start: Pose = ORIGIN
    file: Path = Path("world.yaml")

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

    def obstruction(self, pose: Pose, radius_m: float, time_ns: int = 0) -> Problem | None:
        """What keeps a robot from standing at a pose.

        Args:
            radius_m: Radius of its circular footprint.

        Returns:
            A problem with the line of the shape that is in the way, or None if it fits.
        """
        place = f"a robot with radius {radius_m:g} m cannot be at ({pose.x_m:g}, {pose.y_m:g})"
        if self.bounds is not None:
            x_min, y_min, x_max, y_max = self.bounds
            if not (x_min < pose.x_m < x_max and y_min < pose.y_m < y_max):
                line = next((shape.line for shape in self.shapes if shape.label == "bounds"), None)
                return Problem(f"{place}: that is outside the bounds", line, "bounds")
        shapes = list(self.shapes)
        for obstacle in self.moving:
            at = obstacle.pose_at(time_ns)
            if at is not None:
                shapes.append(obstacle.shape_at(at))
        for shape in shapes:
            clearance_m = shape.clearance_m(pose.x_m, pose.y_m)
            if clearance_m <= radius_m:
                way = "this is there" if clearance_m <= 0.0 else f"this is {clearance_m:.3g} m away"
                return Problem(f"{place}: {way}", shape.line, shape.label)
        return None

    def check_start(self, pose: Pose, radius_m: float) -> None:
        """Refuse a robot that would start inside a wall.

        Raises:
            AssignmentError: With the line of the shape that is in the way.
        """
        problem = self.obstruction(pose, radius_m)
        if problem is not None:
            raise AssignmentError(self.file, [problem])


def read_world(file: Path, values: Values | None = None) -> World:
    """Read a world file.

    Raises:
        UsageError: The file cannot be read.
        AssignmentError: It says something that it must not; with file and line.
    """
    return _world(read_source(file), values or {})


def parse_world(text: str, file: Path = Path("world.yaml"), values: Values | None = None) -> World:
    """Read a world from text; ``file`` is only named in errors.

    Raises:
        AssignmentError: As :func:`read_world`.
    """
    return _world(parse_source(text, file), values or {})


def _world(source: Source, values: Values) -> World:
    source = _with_values(source, values)
    model = source.read(WorldModel)
    segments = len(model.segments) + 4 * len(model.boxes) + len(model.circles)
    segments += sum(len(item.points) for item in model.polygons) + 4 * bool(model.bounds)
    problems: list[Problem] = []
    if segments > MAX_SEGMENTS:
        text = f"{segments} walls and circles: at most {MAX_SEGMENTS} are simulated"
        problems.append(Problem(text))
    if len(model.moving) > MAX_MOVING:
        text = f"{len(model.moving)} moving obstacles: at most {MAX_MOVING} are simulated"
        problems.append(source.problem(("moving",), text))
    if problems:
        raise AssignmentError(source.file, problems)
    shapes = _shapes(model, source, problems)
    if problems:
        raise AssignmentError(source.file, problems)
    moving = tuple(
        item.obstacle(f"moving[{i}]", source.line(("moving", i)))
        for i, item in enumerate(model.moving)
    )
    return World(shapes, moving, model.bounds, model.start, source.file)


def _shapes(model: WorldModel, source: Source, problems: list[Problem]) -> tuple[Shape, ...]:
    found: list[Shape] = []
    if model.bounds is not None:
        x_min, y_min, x_max, y_max = model.bounds
        if x_min >= x_max or y_min >= y_max:
            text = "expected [x_min, y_min, x_max, y_max]: each min must be less than its max"
            problems.append(source.problem(("bounds",), text))
        corners = ((x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max))
        # Unlike a polygon it is filled outside, so that it has no corners of its own.
        outline = polygon("bounds", corners, source.line(("bounds",)))
        found.append(replace(outline, corners=()))
    for i, (x1, y1, x2, y2) in enumerate(model.segments):
        if math.hypot(x2 - x1, y2 - y1) < MIN_SIZE_M:
            problems.append(source.problem(("segments", i), "both ends are the same point"))
        found.append(wall(f"segments[{i}]", x1, y1, x2, y2, source.line(("segments", i))))
    for i, item in enumerate(model.boxes):
        pose = Pose(*item.centre, item.yaw)
        found.append(box(f"boxes[{i}]", pose, item.size, source.line(("boxes", i))))
    for i, pillar in enumerate(model.circles):
        line = source.line(("circles", i))
        found.append(circle(f"circles[{i}]", *pillar.centre, pillar.radius, line))
    for i, area in enumerate(model.polygons):
        for j, (a, b) in enumerate(
            zip(area.points, area.points[1:] + area.points[:1], strict=True)
        ):
            if math.dist(a, b) < MIN_SIZE_M:
                text = "this corner is the same point as the next"
                problems.append(source.problem(("polygons", i, "points", j), text))
        found.append(polygon(f"polygons[{i}]", area.points, source.line(("polygons", i))))
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
