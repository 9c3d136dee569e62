"""The models of a world file (see :mod:`sim.world` for what one looks like)."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Annotated

from pydantic import Field, model_validator

from grader.spec.quantity import Angle, DurationOrZero, Ratio
from grader.spec.source import Model
from sim.colour import Colour
from sim.coordinates import (
    MIN_SIZE_M,
    Ends,
    Point,
    PoseInPlane,
    PoseOrPoint,
    PositiveMetres,
    Rectangle,
    Size,
)
from sim.motion import NS, ORIGIN, Pose, relative
from sim.shapes import (
    HEIGHT_M,
    MAX_SPEED_M_S,
    PAINT,
    FloorLine,
    MovingObstacle,
    Shape,
    Waypoint,
    box,
    circle,
    polygon,
)
from sim.turtles.bounds import CENTRE_M

TURTLE_NAME = r"[A-Za-z][A-Za-z0-9_]*"


class Upright(Model):
    """Something that stands on the floor, as a camera sees it."""

    height: PositiveMetres = Field(
        HEIGHT_M, description="For cameras: a robot and its LiDAR never pass above it."
    )
    colour: Colour = Field(PAINT, description="For cameras.")

    def painted(self, shape: Shape) -> Shape:
        """A shape with this height and colour."""
        return replace(shape, height_m=self.height, colour=self.colour)


class CornerModel(Upright):
    """The outline of a moving box."""

    size: Size = Field(description="Length (along x at yaw 0) and width.")


class RoundModel(Upright):
    """The outline of a moving pillar."""

    radius: PositiveMetres = Field(description="Its radius.")


class BoxModel(CornerModel):
    """A filled rectangle."""

    centre: Point = Field(description="Its centre.")
    yaw: Angle = Field(0.0, description="Counter-clockwise turn.")

    def shape(self, label: str, line: int | None) -> Shape:
        """What the simulation computes with."""
        return self.painted(box(label, Pose(*self.centre, self.yaw), self.size, line))


class CircleModel(RoundModel):
    """A round pillar."""

    centre: Point = Field(description="Its centre.")

    def shape(self, label: str, line: int | None) -> Shape:
        """What the simulation computes with."""
        return self.painted(circle(label, *self.centre, self.radius, line))


class PolygonModel(Upright):
    """A filled polygon."""

    points: tuple[Point, ...] = Field(
        min_length=3, description="Corners in order; the last is joined to the first."
    )

    @model_validator(mode="after")
    def _has_edges(self) -> PolygonModel:
        for i, point in enumerate(self.points):
            if math.dist(self.points[i - 1], point) < MIN_SIZE_M:
                raise ValueError(f"points[{i}] is the same point as the one before")
        return self

    def shape(self, label: str, line: int | None) -> Shape:
        """What the simulation computes with."""
        return self.painted(polygon(label, self.points, line))


class LineModel(Model):
    """A line on the floor, which only cameras see."""

    points: tuple[Point, ...] = Field(min_length=2, description="Its points in order.")
    width: PositiveMetres = Field(0.05, description="How wide it is.")
    colour: Colour = Field((0, 0, 0), description="Its colour.")

    @property
    def line(self) -> FloorLine:
        """What a camera sees."""
        return FloorLine(self.points, self.width, self.colour)


class WaypointModel(Model):
    """A place at a time."""

    at: DurationOrZero = Field(description="Simulated time since the start.")
    pose: PoseOrPoint = Field(description="Its pose at that time; yaw is optional.")


class MovingModel(Model):
    """An obstacle that moves in straight lines between timed waypoints, or only appears."""

    circle: RoundModel | None = Field(None, description="It is a pillar.")
    box: CornerModel | None = Field(None, description="It is a box.")
    path: tuple[WaypointModel, ...] = Field(min_length=1, description="Waypoints with their times.")
    appears: DurationOrZero = Field(0.0, description="Time at which it appears.")
    disappears: DurationOrZero | None = Field(None, description="Time at which it disappears.")
    repeat: bool = Field(False, description="Whether the path starts over at its end.")

    @model_validator(mode="after")
    def _consistent(self) -> MovingModel:
        if (self.circle is None) == (self.box is None):
            raise ValueError("give either 'circle' or 'box'")
        if self.disappears is not None and self.disappears <= self.appears:
            raise ValueError("it disappears before it appears")
        reach_m = self.obstacle("").reach_m
        for index, (before, after) in enumerate(pairwise(self.path)):
            duration_s = after.at - before.at
            if _ns(duration_s) <= 0:
                raise ValueError(f"path[{index + 1}] is not later than path[{index}]")
            way = relative(before.pose, after.pose)
            way_m = math.hypot(way.x_m, way.y_m) + abs(way.yaw_rad) * reach_m
            if way_m > MAX_SPEED_M_S * duration_s:
                raise ValueError(
                    f"from path[{index}] to path[{index + 1}] it moves at "
                    f"{way_m / duration_s:.3g} m/s: at most {MAX_SPEED_M_S:g} m/s are simulated"
                )
        if self.repeat and self.path[0].pose != self.path[-1].pose:
            raise ValueError("to repeat, the last waypoint must be where the first one is")
        return self

    def obstacle(self, label: str, line: int | None = None) -> MovingObstacle:
        """What the simulation computes with."""
        outline = self.circle or self.box
        assert outline is not None
        return MovingObstacle(
            label=label,
            path=tuple(Waypoint(_ns(point.at), point.pose) for point in self.path),
            radius_m=self.circle.radius if self.circle else None,
            size_m=self.box.size if self.box else None,
            appears_ns=_ns(self.appears),
            disappears_ns=None if self.disappears is None else _ns(self.disappears),
            repeat=self.repeat,
            line=line,
            height_m=outline.height,
            colour=outline.colour,
        )


class TurtleModel(Model):
    """A turtle of turtlesim.

    Its topics, services and the action begin with its name: `/turtle1/cmd_vel`, `/turtle1/pose`.
    """

    name: str = Field(pattern=f"^{TURTLE_NAME}$", description="Its name, such as `turtle1`.")
    pose: PoseInPlane = Field(
        Pose(CENTRE_M, CENTRE_M, 0.0),
        description="Where it starts, from the lower left corner; by default in the middle.",
    )


class WorldModel(Model):
    """A world file."""

    bounds: Rectangle | None = Field(None, description="A wall around everything.")
    start: PoseInPlane = Field(
        ORIGIN, description="Where the robot starts, unless a scenario says otherwise."
    )
    values: dict[str, int | float | str] = Field(
        default_factory=dict,
        description="Values of `$name` in this file. A scenario may set other values.",
    )
    segments: tuple[Ends, ...] = Field((), description="Straight walls without thickness.")
    boxes: tuple[BoxModel, ...] = Field((), description="Filled rectangles.")
    circles: tuple[CircleModel, ...] = Field((), description="Round pillars.")
    polygons: tuple[PolygonModel, ...] = Field((), description="Filled polygons.")
    moving: tuple[MovingModel, ...] = Field((), description="Obstacles that move.")
    turtles: tuple[TurtleModel, ...] = Field(
        (),
        description="Turtles in place of a robot and all other keys but `values`: the canvas of "
        "turtlesim, with its services `/spawn`, `/kill`, `/clear` and `/reset`.",
    )
    lines: tuple[LineModel, ...] = Field(
        (), description="Lines on the floor; a later one lies on those before it."
    )
    floor: Colour = Field((205, 205, 205), description="Colour of the floor.")
    light: Annotated[Ratio, Field(ge=0.1, le=2.0)] = Field(
        1.0,
        description="How bright cameras see everything, from 10 % to 200 %: at 100 % colours are "
        "as they are written.",
    )


def _ns(seconds: float) -> int:
    return round(seconds * NS)
