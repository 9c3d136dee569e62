"""The camera: a floor with lines, walls, boxes and pillars, seen through a pinhole, in numpy.

Everything is made of flat polygons. A picture depends on nothing but the world, the options, the
seed, the robot's pose and the time, so that it can be made again, bit by bit, wherever these are
known.

Frames are those of REP-103: the optical frame has z ahead, x to the right and y down, and pixel
(u, v) has its middle at whole numbers, as in OpenCV.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.camera_canvas import NEAR_M, Canvas, Floats, disc, shaded
from sim.camera_options import CameraOptions
from sim.colour import Rgb
from sim.description import BASE_Z_M
from sim.motion import Pose, compose
from sim.shapes import FloorLine, Shape, chord_clearance_m
from sim.world import World

Picture = NDArray[np.uint8]
"""Shape (height, width, 3): red, green, blue."""

_SKY: Rgb = (176, 208, 232)
_LIGHT_FROM = (math.cos(0.5), math.sin(0.5))
"""Horizontal direction of the light: faces of one box differ."""
_NOISE_STEP = 7919
"""Each picture takes its noise so many pixels further on: a prime, so that none is like another."""
_MOMENT_NS = 10_000_000
"""Noise changes with the steps of the simulator."""
_FIRST_MOVING_NUMBER = 1000
_SPAWN_KEY = 1000
"""Tells the camera's seed from those that are spawned for other sensors."""


@dataclass(frozen=True, slots=True)
class VisibleObject:
    """Something that stands in view of a logical camera.

    Attributes:
        kind: ``box``, ``pillar`` or ``obstacle``.
        number: Tells two of a kind apart; what moves has numbers from 1000 on.
        place_m: Its middle from the camera: x ahead, y left, z up, in the frame of its body.
        yaw_rad: Its turn against the robot, counter-clockwise.
        size_m: Length, width and height.
    """

    kind: str
    number: int
    place_m: tuple[float, float, float]
    yaw_rad: float
    size_m: tuple[float, float, float]
    colour: Rgb


@dataclass(frozen=True, slots=True)
class _Footprint:
    """Where something stands on the floor: its middle, its turn and its size."""

    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float


class Camera:
    """A camera in a world."""

    def __init__(self, world: World, options: CameraOptions, seed: tuple[int, ...]) -> None:
        """Prepare what stands still, and the noise.

        Args:
            seed: Of the noise, which is drawn once: every picture takes it from another place.
        """
        self.options = options
        self.focal_px = 0.5 * options.width / math.tan(0.5 * options.fov)
        self.centre_px = (0.5 * (options.width - 1), 0.5 * (options.height - 1))
        self._world = world
        self.seed = seed
        self._walls, self._wall_colours = _walls(world.shapes)
        self._floor = [(piece, line.colour) for line in world.lines for piece in _pieces(line)]
        pixels = options.width * options.height
        source = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_SPAWN_KEY,)))
        noise = source.normal(0.0, 255.0 * options.noise, 2 * pixels) if options.noise else ()
        self._noise = np.rint(noise).astype(np.int16)

    def picture(self, pose: Pose, time_ns: int) -> Picture:
        """What it sees from a robot at a pose in the world's frame."""
        options = self.options
        canvas = Canvas(self, pose)
        for polygon, colour in self._floor:
            canvas.paint(polygon, colour)
        moving = self._world.moving_at(time_ns)
        walls, colours = _walls(moving)
        canvas.paint_walls(np.concatenate((self._walls, walls)), [*self._wall_colours, *colours])
        for shape in (*self._world.shapes, *moving):
            canvas.paint_upright(shape)
        palette = np.array([_SKY, self._world.floor, *canvas.colours], float)
        palette = np.clip(np.rint(palette * self._world.light), 0, 255)
        if not options.noise:
            plain: Picture = palette.astype(np.uint8)[canvas.numbers]
            return plain
        pixels = options.width * options.height
        begin = time_ns // _MOMENT_NS * _NOISE_STEP % pixels
        noise = self._noise[begin : begin + pixels].reshape(options.height, options.width, 1)
        noisy: NDArray[np.int16] = palette.astype(np.int16)[canvas.numbers]
        noisy += noise
        return np.clip(noisy, 0, 255, out=noisy).astype(np.uint8)

    def objects(self, pose: Pose, time_ns: int) -> list[VisibleObject]:
        """What stands in view, the middle of each within range and hidden by nothing else."""
        options = self.options.objects
        if options is None:
            return []
        eye, turn = self.eye(pose)
        shapes = (*self._world.shapes, *self._world.moving_at(time_ns))
        noise = np.random.default_rng([*self.seed, time_ns // _MOMENT_NS])
        objects = []
        for shape in shapes:
            footprint = _footprint(shape)
            if footprint is None:
                continue
            # Drawn for each thing, so that one in view does not change the noise of another.
            error = options.noise * noise.standard_normal(3)
            middle = np.array([footprint.x_m, footprint.y_m, 0.5 * shape.height_m])
            place = turn @ (middle - eye)
            right, down, ahead = place
            is_near = float(np.linalg.norm(place)) <= options.range
            if ahead <= NEAR_M or not is_near or not self._is_in_picture(place):
                continue
            sight = (eye[0], eye[1], footprint.x_m, footprint.y_m)
            if _is_hidden(sight, (other for other in shapes if other is not shape)):
                continue
            kind, number = _kind_and_number(shape)
            visible = VisibleObject(
                kind=kind,
                number=number,
                place_m=(ahead + error[0], -right + error[1], -down + error[2]),
                yaw_rad=math.remainder(footprint.yaw_rad - pose.yaw_rad, math.tau),
                size_m=(footprint.length_m, footprint.width_m, shape.height_m),
                colour=shape.colour,
            )
            objects.append(visible)
        return objects

    def pixel(self, place: Floats) -> tuple[float, float]:
        """Column and row of a place in the optical frame."""
        (u, v), (right, down, ahead) = self.centre_px, place
        return u + self.focal_px * right / ahead, v + self.focal_px * down / ahead

    def eye(self, pose: Pose) -> tuple[Floats, Floats]:
        """Where it is in the world, and the matrix from there into the optical frame."""
        x_m, y_m, z_m = self.options.position
        place = compose(pose, Pose(x_m, y_m, 0.0))
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        level, steep = math.cos(self.options.pitch), math.sin(self.options.pitch)
        turn = np.array(
            [
                [sin, -cos, 0.0],
                [-steep * cos, -steep * sin, -level],
                [level * cos, level * sin, -steep],
            ]
        )
        return np.array([place.x_m, place.y_m, z_m + BASE_Z_M]), turn

    def _is_in_picture(self, place: Floats) -> bool:
        u, v = self.pixel(place)
        return -0.5 <= u <= self.options.width - 0.5 and -0.5 <= v <= self.options.height - 0.5


def _walls(shapes: Iterable[Shape]) -> tuple[Floats, list[tuple[float, float, float]]]:
    """Everything flat that stands: upright rectangles of shape (n, 4, 3), and their colours."""
    walls, colours = [], []
    for shape in shapes:
        high = shape.height_m
        for x1, y1, x2, y2, radius in shape.capsules:
            if radius:
                continue
            walls.append(((x1, y1, 0.0), (x2, y2, 0.0), (x2, y2, high), (x1, y1, high)))
            length = math.hypot(x2 - x1, y2 - y1)
            across = ((y1 - y2) / length, (x2 - x1) / length)
            facing = abs(across[0] * _LIGHT_FROM[0] + across[1] * _LIGHT_FROM[1])
            colours.append(shaded(shape.colour, 0.7 + 0.3 * facing))
    return np.array(walls, float).reshape(-1, 4, 3), colours


def _pieces(line: FloorLine) -> Iterator[Floats]:
    """The polygons of a line on the floor: its pieces, and what is round between them."""
    half = 0.5 * line.width_m
    for (ax, ay), (bx, by) in zip(line.points, line.points[1:], strict=False):
        length = math.hypot(bx - ax, by - ay)
        if length:
            nx, ny = half * (ay - by) / length, half * (bx - ax) / length
            sides = ((ax + nx, ay + ny), (bx + nx, by + ny), (bx - nx, by - ny), (ax - nx, ay - ny))
            yield np.array([(x, y, 0.0) for x, y in sides])
    for x_m, y_m in line.points[1:-1]:
        yield disc(x_m, y_m, half)


def _is_hidden(sight: tuple[float, float, float, float], shapes: Iterable[Shape]) -> bool:
    """Whether any of some shapes stands in a line of sight from (x, y) to (x, y)."""
    capsules = (capsule for shape in shapes for capsule in shape.capsules)
    return any(chord_clearance_m(*sight, capsule) < 0.0 for capsule in capsules)


def _kind_and_number(shape: Shape) -> tuple[str, int]:
    """Kind and number of something that stands by itself; its label is such as ``boxes[2]``."""
    key, _, index = shape.label.rstrip("]").partition("[")
    number = int(index or 0)
    if key == "moving":
        number += _FIRST_MOVING_NUMBER
    if not shape.corners:
        return "pillar", number
    return "obstacle" if key == "polygons" else "box", number


def _footprint(shape: Shape) -> _Footprint | None:
    """Where something that stands by itself stands; None for a wall."""
    x_m, y_m, *_, radius_m = shape.capsules[0]
    if radius_m:
        return _Footprint(x_m, y_m, 0.0, 2.0 * radius_m, 2.0 * radius_m)
    if not shape.corners:
        return None
    corners = np.array(shape.corners)
    ahead = corners[0] - corners[1]
    yaw_rad = math.atan2(ahead[1], ahead[0])
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    turned = corners @ np.array([[cos, -sin], [sin, cos]])
    low, high = turned.min(axis=0), turned.max(axis=0)
    middle = np.array([[cos, -sin], [sin, cos]]) @ (0.5 * (low + high))
    length_m, width_m = high - low
    return _Footprint(float(middle[0]), float(middle[1]), yaw_rad, float(length_m), float(width_m))
