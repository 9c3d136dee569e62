"""The check of a drawn figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.turtle.turtle_check import TurtleParameters, astray
from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Finding, evidence_at
from grader.findings.words import code, counted, metres, percent, point
from grader.measure.turtle.drawing import Line, distances_m, sampled
from grader.recording.model import Recording
from grader.spec.quantity import PositiveLength
from sim.coordinates import Point


class Draws(TurtleParameters):
    """Parameters of turtle.draws."""

    figure: tuple[Point, ...] = Field(
        min_length=2, description="Corners `[x, y]` of the figure, from the lower left corner."
    )
    closed: bool = Field(False, description="Whether the last corner is joined to the first.")
    tolerance: PositiveLength = Field(
        0.15, description="How far the line may be from the figure, and the figure from the line."
    )
    teleports: bool = Field(True, description="Whether a teleport may draw a part of it.")

    def _asked(self) -> str:
        what = "closed figure" if self.closed else "line"
        corners = ", ".join(point(*one) for one in self.figure)
        return f"draws the {what} {corners}, within {metres(self.tolerance)}"


@check("turtle.draws", Subject.RECORDING, Draws)
def draws(recording: Recording, parameters: Draws) -> Finding:
    """A turtle draws the figure.

    Judged by the lines on the canvas at the end, whatever their colour: each point of a line is
    near the figure, and each point of the figure is near a line. A part of the figure, and nothing
    beside it, gives its share of the points.
    """
    lines = parameters.lines(recording)
    jump = next((line for line in lines if line.is_jump), None)
    if jump is not None and not parameters.teleports:
        seen = f"a teleport drew a line of {metres(jump.length_m)}"
        shown = evidence_at(recording, "teleported", jump.times_ns[0])
        service = code(f"/{parameters.turtle}/set_pen")
        return mistaken("turtle_jumped", seen, shown, service=service)
    corners = [*parameters.figure]
    if parameters.closed:
        corners.append(parameters.figure[0])
    wanted = sampled(corners)
    distances = distances_m(wanted, [line.points for line in lines])
    missing = sum(off_m > parameters.tolerance for off_m in distances)
    share = 1.0 - missing / len(wanted)
    off_m, place, line = max((_farthest(line, corners) for line in lines), key=itemgetter(0))
    evidence = evidence_at(recording, f"the line with {point(*place)} begins", line.times_ns[0])
    length_m = sum(line.length_m for line in lines)
    seen = f"{metres(length_m)} in {counted(len(lines), 'line')}"
    if off_m > parameters.tolerance:
        seen += f": at {point(*place)} it is {metres(off_m)} off the figure"
        return astray(recording, seen, parameters.turtle, "turtle_off_figure", evidence)
    if not missing:
        return Finding.as_asked(f"{seen}, at most {metres(off_m)} off", evidence)
    seen += f", which are {percent(round(share, 2))} of the figure"
    partial = astray(recording, seen, parameters.turtle, "turtle_part_only", evidence)
    return replace(partial, credit=share)


def _farthest(line: Line, corners: Sequence[Point]) -> tuple[float, Point, Line]:
    """How far a line is from the figure, and where."""
    places = sampled(line.points)
    off_m, place = max(zip(distances_m(places, [corners]), places, strict=True), key=itemgetter(0))
    return off_m, place, line
