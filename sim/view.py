"""A top-down map of the world in characters, and what a scan shows. No terminal, no colours.

Walls and hits of the LiDAR are drawn in braille, whose characters hold 2 x 4 dots, so that
dots are about square in a terminal.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import IntEnum
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from sim.contact import obstacles_at
from sim.lidar import Lidar, Scan
from sim.motion import Pose, compose
from sim.shapes import Capsule
from sim.world import World

ARROWS = "→↗↑↖←↙↓↘"
_DOTS = np.array(((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80)))
_MARGIN_M = 0.3
_LEAST_M = 2.0
# More dots than a map has across show nothing more.
_MOST_DOTS = 2_000

Points = NDArray[np.float64]
"""Shape (n, 2): x and y in the world's frame, in metres."""


class Layer(IntEnum):
    """What a character shows; the later one wins."""

    EMPTY = 0
    WALL = 1
    MOVING = 2
    HIT = 3
    FOOTPRINT = 4
    ROBOT = 5


Line = list[tuple[str, Layer]]
"""Neighbouring characters of one layer, from the left."""


def draw(
    world: World, pose: Pose, radius_m: float, time_ns: int, hits: Points, columns: int, rows: int
) -> list[Line]:
    """Draw a world with its robot, line by line from the top.

    Args:
        hits: Where the beams of the LiDAR ended (see :func:`hit_points`).
    """
    x_min, y_min, x_max, y_max = world.extent((pose.x_m, pose.y_m))
    width_m = max(x_max - x_min + 2 * _MARGIN_M, _LEAST_M)
    height_m = max(y_max - y_min + 2 * _MARGIN_M, _LEAST_M)
    dots_per_m = min(2 * columns / width_m, 4 * rows / height_m)
    middle = np.array((0.5 * (x_min + x_max), 0.5 * (y_min + y_max)))
    characters = np.zeros((rows, columns), dtype=np.int64)
    layers = np.full((rows, columns), Layer.EMPTY)
    walls = [capsule for shape in world.shapes for capsule in shape.capsules]
    at = np.array(((pose.x_m, pose.y_m),))
    for layer, points in (
        (Layer.WALL, _outlines(walls, dots_per_m)),
        (Layer.MOVING, _outlines(obstacles_at(world.moving, time_ns), dots_per_m)),
        (Layer.HIT, hits),
        (Layer.FOOTPRINT, _outlines([(*at[0], *at[0], radius_m)], dots_per_m)),
        (Layer.ROBOT, at),
    ):
        dots = np.floor((points - middle) * (dots_per_m, -dots_per_m)).astype(np.int64)
        dots += (columns, 2 * rows)
        dots = dots[((dots >= 0) & (dots < (2 * columns, 4 * rows))).all(axis=1)]
        column, row = dots.T
        place = row // 4, column // 2
        np.bitwise_or.at(characters, place, _DOTS[row % 4, column % 2])
        np.maximum.at(layers, place, layer)
    characters[characters > 0] += 0x2800
    characters[characters == 0] = ord(" ")
    characters[layers == Layer.ROBOT] = ord(ARROWS[round(pose.yaw_rad / (math.pi / 4)) % 8])
    return [
        [
            ("".join(chr(one) for one, _ in run), Layer(layer))
            for layer, run in groupby(zip(*line, strict=True), key=lambda pair: pair[1])
        ]
        for line in zip(characters, layers, strict=True)
    ]


def _outlines(capsules: Iterable[Capsule], dots_per_m: float) -> Points:
    """Points on walls and circles, so near to each other that they make lines."""
    found = [np.empty((0, 2))]
    for x1, y1, x2, y2, radius in capsules:
        length_m = math.tau * radius or math.hypot(x2 - x1, y2 - y1)
        share = np.linspace(0.0, 1.0, min(_MOST_DOTS, math.ceil(length_m * dots_per_m) + 2))
        x, y = x1 + share * (x2 - x1), y1 + share * (y2 - y1)
        angle = math.tau * share
        found.append(np.column_stack((x + radius * np.cos(angle), y + radius * np.sin(angle))))
    return np.concatenate(found)


def hit_points(lidar: Lidar, scan: Scan, pose: Pose) -> Points:
    """Where the beams of a scan ended."""
    sensor = compose(pose, lidar.options.pose)
    angles = sensor.yaw_rad + lidar.angles_rad
    ranges = scan.ranges_m.astype(np.float64)
    seen = np.isfinite(ranges) & (ranges > 0.0)
    x = sensor.x_m + ranges[seen] * np.cos(angles[seen])
    y = sensor.y_m + ranges[seen] * np.sin(angles[seen])
    return np.column_stack((x, y))


def range_towards(lidar: Lidar, scan: Scan, direction_rad: float) -> float:
    """What a scan says in a direction of the sensor: 0 ahead, pi/2 left."""
    index = round((direction_rad - lidar.angle_min_rad) / lidar.angle_increment_rad)
    return float(scan.ranges_m[index % lidar.options.beams])
