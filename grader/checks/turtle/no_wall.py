"""The check that a turtle runs into no wall."""

from __future__ import annotations

from grader.checks.check import Subject, check, stop_if
from grader.checks.turtle.turtle_check import TurtleParameters, astray
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.turtle.astray import why_no_turtles
from grader.findings.finding import Evidence, Finding, evidence_at, until_the_end
from grader.findings.words import code, point
from grader.recording.model import Recording


class NoWall(TurtleParameters):
    """Parameters of turtle.no_wall."""

    asks = "`{self.turtle}` moves, and runs into no wall"


@check("turtle.no_wall", Subject.RECORDING, NoWall)
def no_wall(recording: Recording, parameters: NoWall) -> Finding:
    """A turtle runs into no wall.

    One that never moves does not pass.
    """
    stop_if(why_no_turtles(recording))
    way = [step for step in recording.truth if step.robot == parameters.turtle]
    hit = next((step for step in way if step.contact), None)
    if hit is not None:
        shown = evidence_at(recording, "ran into a wall", hit.time_ns)
        return mistaken("turtle_in_wall", f"a wall at {point(hit.x_m, hit.y_m)}", shown)
    if len({(step.x_m, step.y_m, step.yaw_rad) for step in way}) < 2:
        seen = f"{code(parameters.turtle)} never moved"
        shown = Evidence((until_the_end(recording),))
        return astray(recording, seen, parameters.turtle, evidence=shown)
    return Finding.as_asked("no wall", evidence_at(recording, "moved", way[0].time_ns))
