"""How large the canvas of turtles is, as that of turtlesim."""

from __future__ import annotations

Point = tuple[float, float]
Colour = tuple[int, int, int]

PIXELS = 500
PIXELS_PER_M = 45.0
"""The height of the picture of a turtle in turtlesim, which is its metre."""
SIZE_M = (PIXELS - 1) / PIXELS_PER_M
"""Width and height, from wall to wall: 11.0889 m."""
CENTRE_M = SIZE_M / 2.0
