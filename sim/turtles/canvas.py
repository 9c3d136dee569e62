"""The canvas that turtles draw on, pixel by pixel: what their colour sensors see."""

from __future__ import annotations

import math

import numpy as np

from sim.turtles.bounds import PIXELS, PIXELS_PER_M, SIZE_M, Colour, Point

EMPTY: Colour = (255, 255, 255)
"""What the sensor sees where nothing is drawn: the background lies below, like a tablecloth."""


class Canvas:
    """What is drawn; places are in metres, from the lower left corner."""

    def __init__(self) -> None:
        """Begin with nothing drawn."""
        self._pixels = np.empty((PIXELS, PIXELS, 3), dtype=np.uint8)
        self.clear()

    def clear(self) -> None:
        """Take away all lines."""
        self._pixels[:] = EMPTY

    def colour(self, place: Point) -> Colour:
        """What is at a place."""
        column, row = (min(max(round(value), 0), PIXELS - 1) for value in _pixel(place))
        red, green, blue = self._pixels[row, column].tolist()
        return red, green, blue

    def draw(self, begin: Point, end: Point, colour: Colour, width: int) -> None:
        """Draw a straight line with round ends, so many pixels wide."""
        (x1, y1), (x2, y2), reach = _pixel(begin), _pixel(end), width / 2.0
        left, right = _span(min(x1, x2) - reach, max(x1, x2) + reach)
        top, bottom = _span(min(y1, y2) - reach, max(y1, y2) + reach)
        if left >= right or top >= bottom:
            return
        rows, columns = np.mgrid[top:bottom, left:right]
        dx, dy = x2 - x1, y2 - y1
        # How far along the line the nearest point of it is, from 0 to 1; a dot has no length.
        length_squared = dx * dx + dy * dy or 1.0
        share = ((columns - x1) * dx + (rows - y1) * dy) / length_squared
        share = np.clip(share, 0.0, 1.0)
        distance = np.hypot(columns - x1 - share * dx, rows - y1 - share * dy)
        self._pixels[top:bottom, left:right][distance <= max(reach, 0.5)] = colour


def _pixel(place: Point) -> Point:
    """Column and row, which are counted from the upper left corner."""
    return place[0] * PIXELS_PER_M, (SIZE_M - place[1]) * PIXELS_PER_M


def _span(low: float, high: float) -> tuple[int, int]:
    """The pixels of the canvas between two places, as a range."""
    return max(math.floor(max(low, 0.0)), 0), min(math.ceil(min(high, PIXELS)) + 1, PIXELS)
