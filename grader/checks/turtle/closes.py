"""The check that a drawing is closed."""

from __future__ import annotations

import math

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.turtle.turtle_check import TurtleParameters, astray
from grader.findings.finding import Finding, evidence_at
from grader.findings.words import metres, point
from grader.recording.model import Recording
from grader.spec.quantity import PositiveLength


class Closes(TurtleParameters):
    """Parameters of turtle.closes."""

    position: PositiveLength = Field(0.15, description="How near its ends must be.")

    def _asked(self) -> str:
        return f"ends within {metres(self.position)} of where it began"


@check("turtle.closes", Subject.RECORDING, Closes)
def closes(recording: Recording, parameters: Closes) -> Finding:
    """A drawing ends where it began.

    It may lie anywhere on the canvas. Lines of other pens count, too.
    """
    lines = parameters.lines(recording)
    begin, end = lines[0].points[0], lines[-1].points[-1]
    gap_m = math.dist(begin, end)
    seen = f"it began at {point(*begin)} and ended at {point(*end)}: {metres(gap_m)} away"
    shown = evidence_at(recording, "the last line ended", lines[-1].times_ns[-1])
    if gap_m <= parameters.position:
        return Finding.as_asked(seen, shown)
    return astray(recording, seen, parameters.turtle, "turtle_open", shown)
