"""The way to a goal pose: errors, arrival, and turns by the long way."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from grader.findings.finding import Plot
from grader.measure.motion.track import over_time
from grader.recording.model import Recording
from grader.recording.simulated import Truth
from sim.motion import Pose, wrap_angle

NO_SPEED_M_S = 1e-3


@dataclass(frozen=True)
class Approach:
    """A run towards a goal pose in the world's frame; its robot moved."""

    recording: Recording
    goal: Pose

    @property
    def truth(self) -> tuple[Truth, ...]:
        """Every step."""
        return self.recording.truth

    def distance_m(self, step: Truth | Pose) -> float:
        """Distance from the goal."""
        return math.hypot(self.goal.x_m - step.x_m, self.goal.y_m - step.y_m)

    def direction_rad(self, step: Truth | Pose) -> float:
        """The direction of the goal from there, in [-pi, pi]."""
        return math.atan2(self.goal.y_m - step.y_m, self.goal.x_m - step.x_m)

    def bearing_error_rad(self, step: Truth | Pose) -> float:
        """How far the robot would have to turn to look at the goal, in [-pi, pi]."""
        return wrap_angle(self.direction_rad(step) - step.yaw_rad)

    def heading_error_rad(self, step: Truth | Pose) -> float:
        """How far the robot would have to turn to the goal's heading, in [-pi, pi]."""
        return wrap_angle(self.goal.yaw_rad - step.yaw_rad)

    def arrival(self, position_m: float) -> int | None:
        """Index of the first step within a distance of the goal, or None."""
        return next(
            (i for i, step in enumerate(self.truth) if self.distance_m(step) <= position_m), None
        )

    def driven(self, position_m: float) -> int | None:
        """Index of the step after the last one with a commanded speed.

        None where a speed was commanded to the end, or the robot was farther from the goal.
        """
        index = len(self.truth)
        while index and abs(self.truth[index - 1].command_m_s) <= NO_SPEED_M_S:
            index -= 1
        if index == len(self.truth) or self.distance_m(self.truth[index]) > position_m:
            return None
        return index

    @property
    def distance_plot(self) -> Plot:
        """Distance from the goal over time."""
        return over_time(self.recording, "Distance from the goal", "distance (m)", self.distance_m)

    @property
    def heading_plot(self) -> Plot:
        """Heading error over time."""
        return over_time(
            self.recording,
            "Turn to the goal's heading",
            "heading error (°)",
            lambda step: math.degrees(self.heading_error_rad(step)),
        )


def long_turns(
    truth: Sequence[Truth], error: Callable[[Truth], float], tolerance_rad: float
) -> Iterator[Truth]:
    """First steps of turns away from an error, by more than the tolerance, through half a turn.

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
        if error_rad * error(after) < 0.0 and abs(error_rad) > math.pi / 2.0:
            if away_rad > tolerance_rad:
                yield begin
            away_rad, begin = 0.0, None
