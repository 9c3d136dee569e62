"""Turning away from where to turn to, through half a turn: the long way for the short one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from grader.recording.simulated import Truth
from sim.motion import wrap_angle

WRAP_HINT = (
    "An angle error beyond [-pi, pi] makes the long way of the short one: normalise it with "
    "atan2(sin(e), cos(e)) before you multiply it by the gain."
)


@dataclass(frozen=True)
class Detour:
    """A turn by the long way.

    Attributes:
        away_rad: How far it turned away before it passed half a turn, or the run ended.
    """

    step: Truth
    error_rad: float
    away_rad: float
    what: str


def away(
    truth: Sequence[Truth], error: Callable[[Truth], float], tolerance_rad: float, what: str
) -> Iterator[Detour]:
    """Turns away from an error, by more than the tolerance, through half a turn.

    Args:
        error: How far the robot would have to turn at a step, in rad from -pi to pi.
    """
    away_rad = 0.0
    begin: Truth | None = None
    for before, after in pairwise(truth):
        error_rad = error(before)
        turned_rad = wrap_angle(after.yaw_rad - before.yaw_rad)
        if turned_rad * error_rad >= 0.0:
            if turned_rad:
                away_rad, begin = 0.0, None
            continue
        begin = begin or before
        away_rad += abs(turned_rad)
        crosses = error_rad * error(after) < 0.0 and abs(error_rad) > math.pi / 2.0
        if crosses and away_rad > tolerance_rad:
            yield Detour(begin, error(begin), away_rad, what)
        if crosses:
            away_rad, begin = 0.0, None
