"""The camera: a floor with lines, walls, boxes and pillars, seen through a pinhole, in numpy.

Everything is made of flat polygons. Their corners are projected, which for the floor is a
homography, and filled row by row; of two that cover a pixel the nearer one counts, as the inverse
of depth is linear in a picture. Pixels are not blended. A picture depends on nothing but the
world, the options, the seed, the robot's pose and the time, so that it can be made again, bit by
bit, wherever these are known.

Frames are those of REP-103: the optical frame has z ahead, x to the right and y down, and pixel
(u, v) has its middle at whole numbers, as in OpenCV.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.camera_options import CameraOptions
from sim.colour import Rgb
from sim.description import BASE_Z_M
from sim.motion import Pose, compose
from sim.shapes import FloorLine, Shape, chord_clearance_m
from sim.world import World

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]
"""Shape (height, width, 3): red, green, blue."""

_NEAR_M = 0.02
"""What is nearer is not seen: ``clip/near`` of TurtleBot3's camera in Gazebo."""
_SKY: Rgb = (176, 208, 232)
_LIGHT_FROM = (math.cos(0.5), math.sin(0.5))
"""Horizontal direction of the light: faces of one box differ."""
_ROUND = np.arange(16) * (math.tau / 16)
"""Corners of what is round."""
_PRIME = 7919
_MOMENT_NS = 10_000_000
_MOVING_FROM = 1000
_OWN = 1000
"""Tells the camera's seed from those that are spawned for other sensors."""


@dataclass(frozen=True, slots=True)
class Seen:
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
        self._floor = [(polygon, one.colour) for one in world.lines for polygon in _strips(one)]
        pixels = options.width * options.height
        source = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_OWN,)))
        noise = source.normal(0.0, 255.0 * options.noise, 2 * pixels) if options.noise else ()
        self._noise = np.rint(noise).astype(np.int16)

    def picture(self, pose: Pose, time_ns: int) -> Picture:
        """What it sees from a robot at a pose in the world's frame."""
        options = self.options
        canvas = _Canvas(self, pose)
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
        begin = time_ns // _MOMENT_NS * _PRIME % pixels
        noise = self._noise[begin : begin + pixels].reshape(options.height, options.width, 1)
        noisy: NDArray[np.int16] = palette.astype(np.int16)[canvas.numbers]
        noisy += noise
        return np.clip(noisy, 0, 255, out=noisy).astype(np.uint8)

    def objects(self, pose: Pose, time_ns: int) -> list[Seen]:
        """What stands in view, the middle of each within range and hidden by nothing else."""
        wanted = self.options.objects
        if wanted is None:
            return []
        eye, turn = self.eye(pose)
        shapes = (*self._world.shapes, *self._world.moving_at(time_ns))
        noise = np.random.default_rng([*self.seed, time_ns // _MOMENT_NS])
        found = []
        for shape in shapes:
            outline = _outline(shape)
            if outline is None:
                continue
            (x_m, y_m), yaw_rad, (length_m, width_m) = outline
            # Drawn for each thing, so that one in view does not change the noise of another.
            off = wanted.noise * noise.standard_normal(3)
            place = turn @ (np.array([x_m, y_m, 0.5 * shape.height_m]) - eye)
            right, down, ahead = place
            distance_m = float(np.linalg.norm(place))
            if ahead <= _NEAR_M or distance_m > wanted.range or not self._is_inside(place):
                continue
            line = (eye[0], eye[1], x_m, y_m)
            others = (one for other in shapes if other is not shape for one in other.capsules)
            if any(chord_clearance_m(*line, capsule) < 0.0 for capsule in others):
                continue
            body = (ahead + off[0], -right + off[1], -down + off[2])
            size = (length_m, width_m, shape.height_m)
            turned = math.remainder(yaw_rad - pose.yaw_rad, math.tau)
            found.append(Seen(*_named(shape), body, turned, size, shape.colour))
        return found

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

    def _is_inside(self, place: Floats) -> bool:
        u, v = self.pixel(place)
        return -0.5 <= u <= self.options.width - 0.5 and -0.5 <= v <= self.options.height - 0.5


class _Canvas:
    """A picture in the making: the number of a colour for each pixel, and the depth of walls."""

    def __init__(self, camera: Camera, pose: Pose) -> None:
        options = camera.options
        self.colours: list[Iterable[float]] = []
        self._camera = camera
        self._eye, self._turn = camera.eye(pose)
        self._rows = np.arange(options.height, dtype=float)
        self._columns = np.arange(options.width, dtype=float)
        self._margin = np.array([0.5 * options.width, 0.5 * options.height]) / camera.focal_px
        horizon = camera.centre_px[1] - camera.focal_px * math.tan(options.pitch)
        self.numbers = np.zeros((options.height, options.width), np.uint16)
        self.numbers[self._rows > horizon] = 1
        self._near = np.zeros((options.height, options.width), np.float32)
        """The inverse of the depth of what is painted there; the floor is behind all."""

    def paint(self, corners: Floats, colour: Iterable[float]) -> None:
        """Paint a polygon on the floor, over what lies there."""
        self._fill(self._seen(corners), None, colour)

    def paint_walls(self, walls: Floats, colours: list[Iterable[float]]) -> None:
        """Paint upright rectangles, shape (n, 4, 3)."""
        seen = self._seen(walls)
        ahead, aside = seen[..., 2], np.abs(seen[..., :2])
        wide = self._margin * ahead[..., np.newaxis]
        signs = np.sign(seen[..., :2])
        # Out of view: all four corners behind, or all beyond the same side of the picture.
        beyond = (aside > wide) & (signs == signs[:, :1])
        hidden = (ahead < _NEAR_M).all(axis=1) | beyond.all(axis=1).any(axis=1)
        for number in np.flatnonzero(~hidden):
            corners = seen[number]
            normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
            self._fill(corners, normal, colours[number])

    def paint_upright(self, shape: Shape) -> None:
        """Paint the side of a pillar, and the top of what is lower than the camera."""
        x_m, y_m, *_, radius_m = shape.capsules[0]
        dx_m, dy_m = x_m - self._eye[0], y_m - self._eye[1]
        far_m = math.hypot(dx_m, dy_m)
        if radius_m:
            if far_m <= radius_m:
                return
            towards = math.atan2(-dy_m, -dx_m)
            half = math.acos(radius_m / far_m)
            arc = towards + np.linspace(-half, half, 9)
            low = _ring(x_m, y_m, radius_m, arc, 0.0)
            high = _ring(x_m, y_m, radius_m, arc[::-1], shape.height_m)
            side = self._seen(np.concatenate((low, high)))
            # As far away as the line between both its edges.
            normal = self._turn @ np.array([dx_m, dy_m, 0.0])
            self._fill(side, normal, _shaded(shape.colour, 0.9))
            top = _ring(x_m, y_m, radius_m, _ROUND, shape.height_m)
        elif shape.corners:
            top = np.array([(x, y, shape.height_m) for x, y in shape.corners])
        else:
            return
        if shape.height_m < self._eye[2]:
            self._fill(self._seen(top), self._turn @ np.array([0.0, 0.0, 1.0]), shape.colour)

    def _seen(self, places: Floats) -> Floats:
        """Places of the world in the optical frame."""
        found: Floats = (places - self._eye) @ self._turn.T
        return found

    def _fill(self, corners: Floats, normal: Floats | None, colour: Iterable[float]) -> None:
        """Fill a polygon in the optical frame: every pixel whose middle is inside (even-odd).

        Args:
            normal: Of the plane in which it is, for its depth; None for what lies on the floor.
        """
        first = corners[0]
        if corners[:, 2].min() < _NEAR_M:
            corners = _in_front(corners)
            if len(corners) < 3:
                return
        (cu, cv), focal = self._camera.centre_px, self._camera.focal_px
        u = cu + focal * corners[:, 0] / corners[:, 2]
        v = cv + focal * corners[:, 1] / corners[:, 2]
        height, width = self.numbers.shape
        top, bottom = max(0, math.ceil(v.min())), min(height, math.floor(v.max()) + 1)
        left, right = max(0, math.ceil(u.min())), min(width, math.floor(u.max()) + 1)
        if top >= bottom or left >= right:
            return
        rows, columns = self._rows[top:bottom], self._columns[left:right]
        inside = _inside(u, v, rows, columns)
        part = (slice(top, bottom), slice(left, right))
        if normal is not None:
            distance = float(normal @ first)
            if abs(distance) < 1e-12:
                return
            across, down, along = normal / distance
            by_row = along + down * (rows - cv) / focal
            near = (by_row[:, np.newaxis] + across * (columns - cu) / focal).astype(np.float32)
            inside &= near > self._near[part]
            np.copyto(self._near[part], near, where=inside)
        self.colours.append(colour)
        np.copyto(self.numbers[part], len(self.colours) + 1, where=inside)


def _inside(u: Floats, v: Floats, rows: Floats, columns: Floats) -> NDArray[np.bool_]:
    """Which pixels are inside a polygon of corners (u, v)."""
    u_next, v_next = np.roll(u, -1), np.roll(v, -1)
    crosses = (v[:, np.newaxis] > rows) != (v_next[:, np.newaxis] > rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (u_next - u) / (v_next - v)
        at = u[:, np.newaxis] + slope[:, np.newaxis] * (rows - v[:, np.newaxis])
    at = np.where(crosses, at, np.inf)
    at.sort(axis=0)
    inside = np.zeros((len(rows), len(columns)), bool)
    for number in range(0, int(crosses.sum(axis=0).max(initial=0)), 2):
        begin, end = at[number][:, np.newaxis], at[number + 1][:, np.newaxis]
        inside |= (columns >= begin) & (columns < end)
    return inside


def _in_front(corners: Floats) -> Floats:
    """The part of a polygon that is at least as far ahead as the camera sees."""
    kept = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if a[2] >= _NEAR_M:
            kept.append(a)
        if (a[2] >= _NEAR_M) != (b[2] >= _NEAR_M):
            kept.append(a + (_NEAR_M - a[2]) / (b[2] - a[2]) * (b - a))
    return np.array(kept)


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
            colours.append(_shaded(shape.colour, 0.7 + 0.3 * facing))
    return np.array(walls, float).reshape(-1, 4, 3), colours


def _strips(line: FloorLine) -> Iterator[Floats]:
    """The polygons of a line on the floor: its pieces, and what is round between them."""
    half = 0.5 * line.width_m
    for (ax, ay), (bx, by) in zip(line.points, line.points[1:], strict=False):
        length = math.hypot(bx - ax, by - ay)
        if length:
            nx, ny = half * (ay - by) / length, half * (bx - ax) / length
            sides = ((ax + nx, ay + ny), (bx + nx, by + ny), (bx - nx, by - ny), (ax - nx, ay - ny))
            yield np.array([(x, y, 0.0) for x, y in sides])
    for x_m, y_m in line.points[1:-1]:
        yield _ring(x_m, y_m, half, _ROUND, 0.0)


def _ring(x_m: float, y_m: float, radius_m: float, angles: Floats, z_m: float) -> Floats:
    places = (x_m + radius_m * np.cos(angles), y_m + radius_m * np.sin(angles))
    return np.stack((*places, np.full(len(angles), z_m)), axis=1)


def _shaded(colour: Rgb, share: float) -> tuple[float, float, float]:
    red, green, blue = colour
    return share * red, share * green, share * blue


def _named(shape: Shape) -> tuple[str, int]:
    """Kind and number of something that stands by itself."""
    key, _, number = shape.label.rstrip("]").partition("[")
    kind = "pillar" if not shape.corners else "obstacle" if key == "polygons" else "box"
    return kind, int(number or 0) + (_MOVING_FROM if key == "moving" else 0)


def _outline(
    shape: Shape,
) -> tuple[tuple[float, float], float, tuple[float, float]] | None:
    """Middle, turn and size of something that stands by itself; None for a wall."""
    x_m, y_m, *_, radius_m = shape.capsules[0]
    if radius_m:
        return (x_m, y_m), 0.0, (2.0 * radius_m, 2.0 * radius_m)
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
    return (float(middle[0]), float(middle[1])), yaw_rad, (float(length_m), float(width_m))
