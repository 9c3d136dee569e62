"""What the checks of turtles have in common."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Parameters, stop_if
from grader.checks.need import Doubt, WithTurtles
from grader.diagnosis.explanation import explain, mistaken
from grader.diagnosis.turtle.astray import TurtleAstray, why_no_turtles
from grader.findings.finding import Evidence, Finding, until_the_end
from grader.findings.words import code
from grader.measure.turtle.drawing import Line, drawn
from grader.recording.model import Recording

NO_EVIDENCE = Evidence()


class TurtleParameters(Parameters):
    """Base of the parameters of a check of a turtle."""

    about = ("published", "client")
    needs = (WithTurtles(),)
    doubt = Doubt.STEERING_HELD_UP

    turtle: str = Field("turtle1", description="Name of the turtle.")

    def lines(self, recording: Recording) -> tuple[Line, ...]:
        """What it drew; ends the check if that is nothing."""
        stop_if(why_no_turtles(recording))
        lines = tuple(line for line in drawn(recording) if line.turtle == self.turtle)
        if not lines:
            stop_if(self._why_no_line(recording))
        return lines

    def _why_no_line(self, recording: Recording) -> Finding:
        seen = f"{code(self.turtle)} drew no line"
        shown = Evidence((until_the_end(recording),))
        places = {(step.x_m, step.y_m) for step in recording.truth if step.robot == self.turtle}
        if len(places) < 2:
            return astray(recording, seen, self.turtle, evidence=shown)
        service = code(f"/{self.turtle}/set_pen")
        return mistaken("turtle_no_line", f"{seen}: its pen is up", shown, service=service)


def astray(
    recording: Recording,
    seen: str,
    turtle: str,
    mistake: str = "turtle_elsewhere",
    evidence: Evidence = NO_EVIDENCE,
) -> Finding:
    """Why a turtle did not go where it should; without another cause it is the mistake."""
    symptom = TurtleAstray(recording, seen, turtle, evidence)
    return explain(symptom) or mistaken(mistake, seen, evidence)
