"""The check of the corners of a drawing."""

from __future__ import annotations

import math

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.turtle.turtle_check import TurtleParameters, astray
from grader.findings.finding import Evidence, Finding, moment
from grader.findings.words import counted, degrees, point
from grader.measure.turtle.drawing import corners as corners_of
from grader.recording.model import Recording
from grader.spec.quantity import Angle, PositiveLength


class Corners(TurtleParameters):
    """Parameters of turtle.corners."""

    number: int = Field(ge=0, description="How many corners the drawing has.")
    angle: Angle = Field(
        math.pi / 2.0, description="How far the line turns at each, to either side."
    )
    tolerance: Angle = Field(math.radians(10.0), description="How far an angle may be off.")
    position: PositiveLength = Field(
        0.2, description="How near its ends must be so that a corner between them counts."
    )

    def _asked(self) -> str:
        return f"{counted(self.number, 'corner')} of {degrees(self.angle)}"


@check("turtle.corners", Subject.RECORDING, Corners)
def corners(recording: Recording, parameters: Corners) -> Finding:
    """A drawing has its number of corners, with their angle.

    It may lie anywhere on the canvas. A turn within 10 cm of way is one corner; a smaller one than
    25 degrees is none. A closed drawing has a corner where it ends, too.
    """
    found = corners_of(parameters.lines(recording), parameters.position)
    shown = Evidence(
        tuple(moment(recording, f"corner at {point(*one.place)}", one.time_ns) for one in found)
    )
    seen = counted(len(found), "corner")
    wrong = [
        one for one in found if abs(abs(one.angle_rad) - parameters.angle) > parameters.tolerance
    ]
    if len(found) != parameters.number:
        return astray(recording, seen, parameters.turtle, "turtle_corners", shown)
    if wrong:
        first = wrong[0]
        seen += f": that at {point(*first.place)} turns by {degrees(abs(first.angle_rad))}"
        return astray(recording, seen, parameters.turtle, "turtle_angles", shown)
    return Finding.as_asked(seen, shown)
