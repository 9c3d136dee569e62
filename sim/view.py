"""A top-down map of the world in characters. Pure: no terminal, no colours.

Walls and hits of the LiDAR are drawn in braille, whose characters hold 2 x 4 dots, so that
dots are about square in a terminal.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass
from enum import Enum
from itertools import groupby

from sim.contact import obstacles_at
from sim.lidar import Lidar, Scan
from sim.motion import Pose, compose
from sim.shapes import Capsule
from sim.world import World

ARROWS = "→↗↑↖←↙↓↘"
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_MARGIN_M = 0.3
_LEAST_M = 2.0


class Layer(Enum):
    """What a character shows; the later one wins."""

    EMPTY = 0
    WALL = 1
    MOVING = 2
    HIT = 3
    FOOTPRINT = 4
    ROBOT = 5


@dataclass(frozen=True, slots=True)
class Run:
    """Neighbouring characters of one layer."""

    text: str
    layer: Layer


class Map:
    """A canvas that knows where metres are."""

    def __init__(
        self, extent_m: tuple[float, float, float, float], columns: int, rows: int
    ) -> None:
        """Fit a rectangle of the world into a rectangle of characters.

        Args:
            extent_m: x_min, y_min, x_max, y_max that must be visible.
        """
        x_min, y_min, x_max, y_max = extent_m
        width_m = max(x_max - x_min + 2 * _MARGIN_M, _LEAST_M)
        height_m = max(y_max - y_min + 2 * _MARGIN_M, _LEAST_M)
        self.dots_per_m = min(2 * columns / width_m, 4 * rows / height_m)
        self.columns, self.rows = columns, rows
        self._centre = (0.5 * (x_min + x_max), 0.5 * (y_min + y_max))
        # One number for each character, line by line: plain lists, for dots come one by one.
        self._dots = [0] * (columns * rows)
        self._layers = [Layer.EMPTY.value] * (columns * rows)
        self._letters: dict[int, str] = {}

    def copy(self) -> Map:
        """A canvas to draw on without changing this one."""
        other = copy(self)
        other._dots, other._layers = self._dots[:], self._layers[:]
        other._letters = dict(self._letters)
        return other

    def point(self, x_m: float, y_m: float, layer: Layer) -> None:
        """Draw a dot; outside the map nothing happens."""
        column, row = self._dot(x_m, y_m)
        if 0 <= column < 2 * self.columns and 0 <= row < 4 * self.rows:
            place = row // 4 * self.columns + column // 2
            self._dots[place] |= _DOTS[row % 4][column % 2]
            self._layers[place] = max(self._layers[place], layer.value)

    def letter(self, x_m: float, y_m: float, character: str, layer: Layer) -> None:
        """Write a character over whatever is drawn there."""
        column, row = self._dot(x_m, y_m)
        if 0 <= column < 2 * self.columns and 0 <= row < 4 * self.rows:
            place = row // 4 * self.columns + column // 2
            self._letters[place] = character
            self._layers[place] = layer.value

    def capsule(self, capsule: Capsule, layer: Layer) -> None:
        """Draw a wall or a circle."""
        x1, y1, x2, y2, radius = capsule
        length_m = math.tau * radius if radius else math.hypot(x2 - x1, y2 - y1)
        # More dots than the map has across show nothing more.
        most = 8 * (self.columns + 2 * self.rows)
        count = max(2, min(most, math.ceil(length_m * self.dots_per_m) + 1))
        for i in range(count):
            share = i / (count - 1)
            if radius:
                angle = math.tau * share
                self.point(x1 + radius * math.cos(angle), y1 + radius * math.sin(angle), layer)
            else:
                self.point(x1 + share * (x2 - x1), y1 + share * (y2 - y1), layer)

    def lines(self) -> list[list[Run]]:
        """The map, line by line from the top."""
        return [self._line(row * self.columns) for row in range(self.rows)]

    def _line(self, begin: int) -> list[Run]:
        runs = []
        places = range(begin, begin + self.columns)
        for layer, group in groupby(places, key=self._layers.__getitem__):
            runs.append(Run("".join(self._character(place) for place in group), Layer(layer)))
        return runs

    def _character(self, place: int) -> str:
        dots = self._dots[place]
        return self._letters.get(place) or (chr(0x2800 + dots) if dots else " ")

    def _dot(self, x_m: float, y_m: float) -> tuple[int, int]:
        column = self.columns + (x_m - self._centre[0]) * self.dots_per_m
        row = 2 * self.rows - (y_m - self._centre[1]) * self.dots_per_m
        return math.floor(column), math.floor(row)


class Drawing:
    """Draws a world with its robot again and again; what stands still is drawn once."""

    def __init__(self, world: World, radius_m: float) -> None:
        """Prepare."""
        self._world, self._radius_m = world, radius_m
        self._extent_m = world.extent()
        self._base: tuple[object, Map] | None = None

    def lines(
        self,
        pose: Pose,
        time_ns: int,
        columns: int,
        rows: int,
        hits: list[tuple[float, float]] | None = None,
    ) -> list[list[Run]]:
        """Draw it.

        Args:
            hits: What the LiDAR sees, in the world's frame (see :func:`hit_points`).
        """
        canvas = self._walls(self._visible(pose), columns, rows).copy()
        for capsule in obstacles_at(self._world.moving, time_ns):
            canvas.capsule(capsule, Layer.MOVING)
        for x_m, y_m in hits or []:
            canvas.point(x_m, y_m, Layer.HIT)
        canvas.capsule((pose.x_m, pose.y_m, pose.x_m, pose.y_m, self._radius_m), Layer.FOOTPRINT)
        arrow = ARROWS[round(pose.yaw_rad / (math.pi / 4)) % 8]
        canvas.letter(pose.x_m, pose.y_m, arrow, Layer.ROBOT)
        return canvas.lines()

    def _visible(self, pose: Pose) -> tuple[float, float, float, float]:
        x_min, y_min, x_max, y_max = self._extent_m
        x_m, y_m = pose.x_m, pose.y_m
        # By whole metres, so that the walls are seldom drawn anew when the robot leaves the map.
        return (
            x_min if x_m >= x_min else math.floor(x_m),
            y_min if y_m >= y_min else math.floor(y_m),
            x_max if x_m <= x_max else math.ceil(x_m),
            y_max if y_m <= y_max else math.ceil(y_m),
        )

    def _walls(self, extent_m: tuple[float, float, float, float], columns: int, rows: int) -> Map:
        key = (extent_m, columns, rows)
        if self._base is None or self._base[0] != key:
            canvas = Map(extent_m, columns, rows)
            for shape in self._world.shapes:
                for capsule in shape.capsules:
                    canvas.capsule(capsule, Layer.WALL)
            self._base = (key, canvas)
        return self._base[1]


def hit_points(lidar: Lidar, scan: Scan, pose: Pose) -> list[tuple[float, float]]:
    """Where the beams of a scan ended, in the world's frame."""
    sensor = compose(pose, lidar.options.pose)
    found = []
    for index, range_m in enumerate(scan.ranges_m.tolist()):
        if math.isfinite(range_m) and range_m > 0.0:
            angle = sensor.yaw_rad + lidar.angle_min_rad + index * lidar.angle_increment_rad
            found.append(
                (sensor.x_m + range_m * math.cos(angle), sensor.y_m + range_m * math.sin(angle))
            )
    return found


def range_towards(lidar: Lidar, scan: Scan, direction_rad: float) -> float:
    """What a scan says in a direction of the sensor: 0 ahead, pi/2 left."""
    index = round((direction_rad - lidar.angle_min_rad) / lidar.angle_increment_rad)
    return float(scan.ranges_m[index % lidar.options.beams])
