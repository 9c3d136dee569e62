"""How a robot moved along a line on the floor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise

from grader.recording.simulated import Truth

Points = Sequence[tuple[float, float]]

_AHEAD_M = 0.3
"""How far along a line the robot is looked for: where a line crosses itself, it does not jump."""


def length_m(line: Points) -> float:
    """The length of a line."""
    return sum(math.dist(a, b) for a, b in pairwise(line))


def distance_m(line: Points, step: Truth) -> float:
    """How far the middle of the robot is from a line."""
    return min(distance for distance, _ in _feet(line, step, 0.0, math.inf))


def followed_m(line: Points, truth: Sequence[Truth], within_m: float) -> Iterator[float]:
    """After each step, how far along a line from its first point on the robot is, near the line."""
    along_m = 0.0
    for number, step in enumerate(truth):
        far = along_m + _AHEAD_M if number else math.inf
        distance, at_m = min(_feet(line, step, along_m, far))
        if distance <= within_m:
            along_m = at_m
        yield along_m


def _feet(line: Points, step: Truth, begin_m: float, end_m: float) -> Iterator[tuple[float, float]]:
    """For each piece of a part of a line: how far it is, and where along the line."""
    starts = accumulate((math.dist(a, b) for a, b in pairwise(line)), initial=0.0)
    for start_m, ((ax, ay), (bx, by)) in zip(starts, pairwise(line), strict=False):
        long_m = math.dist((ax, ay), (bx, by))
        low_m, high_m = max(0.0, begin_m - start_m), min(long_m, end_m - start_m)
        if not long_m or low_m > high_m:
            continue
        ux, uy = (bx - ax) / long_m, (by - ay) / long_m
        foot_m = min(max((step.x_m - ax) * ux + (step.y_m - ay) * uy, low_m), high_m)
        off_m = math.hypot(step.x_m - ax - foot_m * ux, step.y_m - ay - foot_m * uy)
        yield off_m, start_m + foot_m
