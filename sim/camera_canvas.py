"""The canvas of a camera: polygons of the world, projected through a pinhole and filled row by row.

Pixels are not blended. Of two polygons that cover a pixel the nearer one counts: the inverse of
depth is linear in a picture, so it is known for every pixel of a plane.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.camera_options import CameraOptions
from sim.colour import Rgb
from sim.motion import Pose
from sim.shapes import Shape

Floats = NDArray[np.float64]

NEAR_M = 0.02
"""What is nearer is not seen: ``clip/near`` of TurtleBot3's camera in Gazebo."""
_FULL_TURN = np.arange(16) * (math.tau / 16)
"""Corners of what is round."""


class Pinhole(Protocol):
    """What a canvas has to know of its camera."""

    options: CameraOptions
    focal_px: float
    centre_px: tuple[float, float]

    def eye(self, pose: Pose) -> tuple[Floats, Floats]:
        """Where it is in the world, and the matrix from there into the optical frame."""


class Canvas:
    """A picture in the making: the number of a colour for each pixel, and the depth of walls."""

    def __init__(self, camera: Pinhole, pose: Pose) -> None:
        options = camera.options
        self.colours: list[Iterable[float]] = []
        self._camera = camera
        self._eye, self._turn = camera.eye(pose)
        self._rows = np.arange(options.height, dtype=float)
        self._columns = np.arange(options.width, dtype=float)
        self._half_view = np.array([0.5 * options.width, 0.5 * options.height]) / camera.focal_px
        """Half of what is in view at a depth of 1 m, aside and down."""
        horizon = camera.centre_px[1] - camera.focal_px * math.tan(options.pitch)
        # 0 is the sky, 1 the floor, and those of `colours` begin at 2.
        self.numbers = np.zeros((options.height, options.width), np.uint16)
        self.numbers[self._rows > horizon] = 1
        self._inverse_depth = np.zeros((options.height, options.width), np.float32)
        """Of what is painted there; the floor is behind all."""

    def paint(self, corners: Floats, colour: Iterable[float]) -> None:
        """Paint a polygon on the floor, over what lies there."""
        self._fill(self._to_optical(corners), None, colour)

    def paint_walls(self, walls: Floats, colours: list[Iterable[float]]) -> None:
        """Paint upright rectangles, shape (n, 4, 3)."""
        optical = self._to_optical(walls)
        depths, offsets = optical[..., 2], optical[..., :2]
        signs = np.sign(offsets)
        # Out of view: all four corners behind, or all beyond the same side of the picture.
        is_outside = np.abs(offsets) > self._half_view * depths[..., np.newaxis]
        beyond_one_side = (is_outside & (signs == signs[:, :1])).all(axis=1).any(axis=1)
        is_hidden = (depths < NEAR_M).all(axis=1) | beyond_one_side
        for number in np.flatnonzero(~is_hidden):
            corners = optical[number]
            normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
            self._fill(corners, normal, colours[number])

    def paint_upright(self, shape: Shape) -> None:
        """Paint the side of a pillar, and the top of what is lower than the camera."""
        x_m, y_m, *_, radius_m = shape.capsules[0]
        if radius_m:
            if math.hypot(x_m - self._eye[0], y_m - self._eye[1]) <= radius_m:
                return
            self._paint_side(shape)
            top = ring(x_m, y_m, radius_m, _FULL_TURN, shape.height_m)
        elif shape.corners:
            top = np.array([(x, y, shape.height_m) for x, y in shape.corners])
        else:
            return
        if shape.height_m < self._eye[2]:
            upwards = self._turn @ np.array([0.0, 0.0, 1.0])
            self._fill(self._to_optical(top), upwards, shape.colour)

    def _paint_side(self, pillar: Shape) -> None:
        """Paint the half of a pillar that looks towards the camera."""
        x_m, y_m, *_, radius_m = pillar.capsules[0]
        dx_m, dy_m = x_m - self._eye[0], y_m - self._eye[1]
        towards_eye = math.atan2(-dy_m, -dx_m)
        half = math.acos(radius_m / math.hypot(dx_m, dy_m))
        arc = towards_eye + np.linspace(-half, half, 9)
        low = ring(x_m, y_m, radius_m, arc, 0.0)
        high = ring(x_m, y_m, radius_m, arc[::-1], pillar.height_m)
        corners = self._to_optical(np.concatenate((low, high)))
        # As far away as the line between both its edges.
        normal = self._turn @ np.array([dx_m, dy_m, 0.0])
        self._fill(corners, normal, shaded(pillar.colour, 0.9))

    def _to_optical(self, places: Floats) -> Floats:
        """Places of the world in the optical frame."""
        optical: Floats = (places - self._eye) @ self._turn.T
        return optical

    def _fill(self, corners: Floats, normal: Floats | None, colour: Iterable[float]) -> None:
        """Fill a polygon in the optical frame: every pixel whose middle is inside (even-odd).

        Args:
            normal: Of the plane in which it is, for its depth; None for what lies on the floor.
        """
        in_plane = corners[0]
        if corners[:, 2].min() < NEAR_M:
            corners = _in_front(corners)
            if len(corners) < 3:
                return
        (centre_u, centre_v), focal = self._camera.centre_px, self._camera.focal_px
        u = centre_u + focal * corners[:, 0] / corners[:, 2]
        v = centre_v + focal * corners[:, 1] / corners[:, 2]
        height, width = self.numbers.shape
        top, bottom = max(0, math.ceil(v.min())), min(height, math.floor(v.max()) + 1)
        left, right = max(0, math.ceil(u.min())), min(width, math.floor(u.max()) + 1)
        if top >= bottom or left >= right:
            return
        rows, columns = self._rows[top:bottom], self._columns[left:right]
        painted = _inside(u, v, rows, columns)
        part = (slice(top, bottom), slice(left, right))
        if normal is not None:
            distance = float(normal @ in_plane)
            # Seen along its plane it has no area.
            if abs(distance) < 1e-12:
                return
            by_column, by_row, constant = normal / distance
            of_rows = constant + by_row * (rows - centre_v) / focal
            of_columns = by_column * (columns - centre_u) / focal
            inverse_depth = (of_rows[:, np.newaxis] + of_columns).astype(np.float32)
            painted &= inverse_depth > self._inverse_depth[part]
            np.copyto(self._inverse_depth[part], inverse_depth, where=painted)
        self.colours.append(colour)
        np.copyto(self.numbers[part], len(self.colours) + 1, where=painted)


def _inside(u: Floats, v: Floats, rows: Floats, columns: Floats) -> NDArray[np.bool_]:
    """Which pixels are inside a polygon of corners (u, v), so right of an odd number of edges."""
    u_next, v_next = np.roll(u, -1), np.roll(v, -1)
    crosses = (v[:, np.newaxis] > rows) != (v_next[:, np.newaxis] > rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (u_next - u) / (v_next - v)
        crossings = u[:, np.newaxis] + slope[:, np.newaxis] * (rows - v[:, np.newaxis])
    crossings = np.where(crosses, crossings, np.inf)
    crossings.sort(axis=0)
    inside = np.zeros((len(rows), len(columns)), bool)
    for number in range(0, int(crosses.sum(axis=0).max(initial=0)), 2):
        begin, end = crossings[number][:, np.newaxis], crossings[number + 1][:, np.newaxis]
        inside |= (columns >= begin) & (columns < end)
    return inside


def _in_front(corners: Floats) -> Floats:
    """The part of a polygon that is at least as far ahead as the camera sees."""
    clipped = []
    for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        is_in_front = corner[2] >= NEAR_M
        if is_in_front:
            clipped.append(corner)
        if is_in_front != (following[2] >= NEAR_M):
            share = (NEAR_M - corner[2]) / (following[2] - corner[2])
            clipped.append(corner + share * (following - corner))
    return np.array(clipped)


def disc(x_m: float, y_m: float, radius_m: float) -> Floats:
    """What is round, lying on the floor."""
    return ring(x_m, y_m, radius_m, _FULL_TURN, 0.0)


def ring(x_m: float, y_m: float, radius_m: float, angles: Floats, z_m: float) -> Floats:
    """Places on a level circle, at angles."""
    places = (x_m + radius_m * np.cos(angles), y_m + radius_m * np.sin(angles))
    return np.stack((*places, np.full(len(angles), z_m)), axis=1)


def shaded(colour: Rgb, share: float) -> tuple[float, float, float]:
    """A colour that gets a share of the light."""
    red, green, blue = colour
    return share * red, share * green, share * blue
