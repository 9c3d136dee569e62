"""What the checks of the simulated robot's motion have in common."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from grader.checks.check import Parameters, stop_if
from grader.checks.need import Doubt, Need, SimulatedRobot
from grader.diagnosis.motion.missed_goal import why_not_there
from grader.diagnosis.motion.no_motion import approach, why_not_moved
from grader.findings.finding import Evidence, Finding, until_the_end
from grader.findings.reference import GoalPose
from grader.measure.motion.approach import Approach
from grader.measure.motion.track import speed_plot
from grader.recording.model import Recording
from grader.recording.simulated import Scene
from grader.spec.quantity import PositiveLength


class RobotParameters(Parameters):
    """Base of the parameters of a check of the robot's true motion."""

    of_bags = True
    about = ("published",)
    needs: ClassVar[tuple[Need, ...]] = (SimulatedRobot(),)
    doubt = Doubt.STEERING_HELD_UP


class GoalParameters(RobotParameters):
    """Base of the parameters of a check of the way to a goal."""

    goal: GoalPose = Field(
        description="Goal pose `[x, y, theta]` in the world's frame: metres and an angle, or "
        "names of the scenario's values."
    )
    position: PositiveLength = Field(0.1, description="How near the goal counts as reached.")

    def approach(self, recording: Recording) -> Approach:
        """The way to the goal; ends the check if the robot never moved."""
        run = approach(recording, self.goal)
        stop_if(run if isinstance(run, Finding) else None)
        assert isinstance(run, Approach)
        return run

    def arrival(self, run: Approach) -> int:
        """Index of the first step near the goal; ends the check if there is none."""
        arrival = run.arrival(self.position)
        if arrival is None:
            stop_if(why_not_there(run, self.position))
        assert arrival is not None
        return arrival


def moved_in(recording: Recording) -> Scene:
    """What the robot drove in; ends the check if it never moved."""
    stop_if(why_not_moved(recording))
    assert recording.scene is not None
    return recording.scene


def at_the_end(recording: Recording, label: str) -> Evidence:
    """The end of the observation, with the robot's speed until then."""
    return Evidence((until_the_end(recording, label),), plots=(speed_plot(recording),))
