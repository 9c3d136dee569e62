"""What the checks of the simulated robot's motion have in common."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Parameters
from grader.checks.need import Doubt, SimulatedRobot
from grader.findings.reference import GoalPose
from grader.spec.quantity import PositiveLength


class RobotParameters(Parameters):
    """Base of the parameters of a check of the robot's true motion."""

    about = ("published",)
    needs = (SimulatedRobot(),)
    doubt = Doubt.STEERING_HELD_UP


class GoalParameters(RobotParameters):
    """Base of the parameters of a check of the way to a goal."""

    goal: GoalPose = Field(
        description="Goal pose `[x, y, theta]` in the world's frame: metres and an angle, or "
        "random values."
    )
    position: PositiveLength = Field(0.1, description="How near the goal counts as reached.")
