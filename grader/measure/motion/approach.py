"""The way to a goal pose: errors and arrival."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grader.checks.finding import Plot
from grader.measure.motion.track import over_time
from grader.recording.model import Recording
from grader.recording.simulated import Truth
from sim.motion import Pose, wrap_angle

NO_SPEED_M_S = 1e-3


@dataclass(frozen=True)
class Approach:
    """A run towards a goal.

    Attributes:
        recording: The run; its robot moved.
        goal: In the world's frame.
    """

    recording: Recording
    goal: Pose

    @property
    def truth(self) -> tuple[Truth, ...]:
        """Every step."""
        return self.recording.truth

    def distance_m(self, step: Truth) -> float:
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
        """Index of the step after which, near the goal, nothing but turns is commanded.

        Args:
            position_m: How near the goal it must be.

        Returns:
            The step after the last one with a commanded speed, or None where speed was
            commanded to the end or the robot was not near then.
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
