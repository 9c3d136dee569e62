"""Contact: how far a circular robot gets along an arc before it touches something.

Contact stops the translation; turning on the spot goes on, since it moves no circle. The
first contact within a step is found, however thin a wall is and however long the step:
an interval of the arc counts as free only if its chord keeps its distance from every wall by
more than the arc's sagitta. Intervals grow while they are free and shrink to a nanometre
where they are not, which is where the robot stops.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.motion import Pose, integrate
from sim.shapes import Capsule, chord_clearance_m, point_clearance_m
from sim.world import World

RESOLUTION_M = 1e-9
"""The place of a contact is found to this precision, and no motion shorter than this is made
against a wall, so that a robot which pushes against one stays where it is to the last bit."""

TOUCH_M = 1e-6
"""A robot that is nearer than this touches."""

_ROUNDING_M = 1e-12
_SIGHT_M = 0.5


class Contact(NamedTuple):
    """How much of a translation was possible, in [0, 1], and the label of what is touched."""

    share: float
    label: str | None


_Near = tuple[tuple[Capsule, str], ...]


class ContactFinder:
    """Finds contacts of one robot in one world.

    It remembers which walls are near, so that a step in free space costs nothing.
    """

    def __init__(self, world: World, radius_m: float) -> None:
        """Prepare the world for a robot with a circular footprint."""
        self._radius_m = radius_m
        self._all: _Near = tuple(
            (capsule, shape.label) for shape in world.shapes for capsule in shape.capsules
        )
        self._world = world
        self._near: _Near = ()
        self._anchor = (math.inf, math.inf)
        self._sight_m = 0.0

    def find(
        self, pose: Pose, linear_m_s: float, angular_rad_s: float, dt_s: float, end_ns: int
    ) -> Contact:
        """Look for the first contact of one step.

        Args:
            end_ns: Simulated time at its end; moving obstacles are already there.
        """
        travel_m = abs(linear_m_s) * dt_s
        near = self._walls_near(pose, travel_m) + self._moving(pose, end_ns)
        if not near:
            return Contact(1.0, None)
        share, hit = 1.0, None
        if travel_m > 0.0:
            share, hit = self._advance(pose, linear_m_s, angular_rad_s, dt_s, near)
        end = integrate(pose, linear_m_s, angular_rad_s, dt_s * share)
        clearance_m, label = min((self._clearance_m(end, item), label) for item, label in near)
        return Contact(share, hit or (label if clearance_m <= TOUCH_M else None))

    def _clearance_m(self, pose: Pose, capsule: Capsule) -> float:
        return point_clearance_m(pose.x_m, pose.y_m, capsule) - self._radius_m

    def _walls_near(self, pose: Pose, travel_m: float) -> _Near:
        """Walls that this step could reach, with some to spare for the next steps."""
        way_m = math.dist(self._anchor, (pose.x_m, pose.y_m))
        if way_m + travel_m + TOUCH_M >= self._sight_m:
            self._anchor = (pose.x_m, pose.y_m)
            self._sight_m = max(_SIGHT_M, 4.0 * travel_m)
            self._near = tuple(
                item for item in self._all if self._clearance_m(pose, item[0]) < self._sight_m
            )
        return self._near

    def _moving(self, pose: Pose, time_ns: int) -> _Near:
        found: list[tuple[Capsule, str]] = []
        for shape in self._world.moving_at(time_ns):
            found.extend((capsule, shape.label) for capsule in shape.capsules)
            if shape.contains(pose.x_m, pose.y_m):
                found.append(((pose.x_m, pose.y_m, pose.x_m, pose.y_m, 0.0), shape.label))
        return tuple(found)

    def _advance(
        self, pose: Pose, linear_m_s: float, angular_rad_s: float, dt_s: float, near: _Near
    ) -> tuple[float, str | None]:
        travel_m = abs(linear_m_s) * dt_s
        allowed: list[tuple[Capsule, str, float]] = []
        for capsule, label in near:
            clearance_m = self._clearance_m(pose, capsule)
            if clearance_m <= travel_m + TOUCH_M:
                # A robot that something moved onto may leave, but not go deeper.
                deepest_m = min(-RESOLUTION_M, clearance_m - _ROUNDING_M)
                allowed.append((capsule, label, self._radius_m + deepest_m))
        if not allowed:
            return 1.0, None
        least = min(1.0, RESOLUTION_M / travel_m)
        begin, length = 0.0, 1.0
        here = pose
        while begin < 1.0:
            end = min(1.0, begin + length)
            there = integrate(pose, linear_m_s, angular_rad_s, dt_s * end)
            part = end - begin
            sagitta_m = 0.125 * travel_m * abs(angular_rad_s) * dt_s * part * part
            hit = next(
                (
                    label
                    for capsule, label, distance_m in allowed
                    if chord_clearance_m(here.x_m, here.y_m, there.x_m, there.y_m, capsule)
                    < distance_m + sagitta_m
                ),
                None,
            )
            if hit is None:
                begin, here = end, there
                length *= 2.0
            elif length <= least:
                return begin, hit
            else:
                length = max(least, 0.125 * min(length, part))
        return 1.0, None
