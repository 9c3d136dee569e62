"""What every check of the simulated robot's motion has in common."""

from __future__ import annotations

from grader.checks.check import Parameters
from grader.checks.need import Doubt, SimulatedRobot


class RobotParameters(Parameters):
    """Base of the parameters of a check of the robot's true motion."""

    needs = (SimulatedRobot(),)
    doubt = Doubt.STEERING_HELD_UP
