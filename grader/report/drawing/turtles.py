"""The canvas of turtles: what they drew, the figures that were asked for, and where they are.

Lines and the background have the colours that the student gave them, light and dark alike.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Sequence

from markupsafe import Markup
from pydantic import ValidationError

from grader.assignment.model import Assignment, Visibility
from grader.checks.turtle.draws import Draws
from grader.findings.words import counted, listing, metres
from grader.measure.turtle.drawing import Colour, Line, drawn
from grader.recording.model import Recording
from grader.recording.simulated import Truth
from grader.report.drawing import svg
from grader.report.drawing.svg import Point
from sim.turtles.bounds import PIXELS, SIZE_M

BACKGROUND: Colour = (69, 86, 255)
MOST_LINES = 1_000
_TOLERANCE_PX = 0.4
_EDGE = 26.0
"""Room for the numbers beside the canvas, in pixels."""
_Pixel = Callable[[Point], Point]
_BODY = ((9.0, 0.0), (-6.0, 6.0), (-3.0, 0.0), (-6.0, -6.0))


def figures(assignment: Assignment, scenario: str) -> tuple[tuple[Point, ...], ...]:
    """The figures that visible checks ask for in a scenario, each once."""
    found: dict[tuple[Point, ...], None] = {}
    for check in assignment.checks:
        judged = not check.scenarios or scenario in check.scenarios
        if check.uses != "turtle.draws" or not judged or check.visibility is not Visibility.VISIBLE:
            continue
        with contextlib.suppress(ValidationError):
            asked = Draws.model_validate(check.with_)
            found[(*asked.figure, *asked.figure[: asked.closed])] = None
    return tuple(found)


def draw_turtles(
    recording: Recording, asked: Sequence[Sequence[Point]], name: str
) -> svg.Figure | None:
    """Draw the canvas at the end; None in a scenario without turtles."""
    if not recording.turtles:
        return None
    lines = drawn(recording)[-MOST_LINES:]
    last = {step.robot: step for step in recording.truth}
    killed = [one for one in recording.turtles if one.kind == "killed"]
    gone = {one.turtle for one in killed}
    there = [step for step in last.values() if step.robot not in gone]
    background = next(
        (one.colour for one in reversed(recording.turtles) if one.kind == "background"), BACKGROUND
    )

    def draw(width: float) -> tuple[float, list[Markup]]:
        side = min(width - 2.0 * _EDGE, 420.0)
        left, scale = (width - side) / 2.0, side / SIZE_M

        def pixel(place: Point) -> Point:
            # What is drawn beyond the walls ends there.
            x_m, y_m = (min(max(one, 0.0), SIZE_M) for one in place)
            return left + x_m * scale, 8.0 + (SIZE_M - y_m) * scale

        canvas = [
            svg.element("rect", x=left, y=8.0, width=side, height=side, fill=_rgb(background)),
            *(_line(one, pixel, side / PIXELS) for one in lines),
            *(svg.curve([pixel(one) for one in figure], "turtle-asked") for figure in asked),
        ]
        marks = [mark for step in there for mark in _turtle(step, pixel)]
        for number, one in enumerate(killed, start=1):
            x, y = pixel((one.x_m, one.y_m))
            marks.append(svg.crosses([(x, y)], "turtle-mark"))
            marks.append(svg.label(f"{number}. {one.turtle}", *_beside(x, y, width), "on-canvas"))
        return side + 8.0 + _EDGE, [svg.element("g", *canvas), *marks, *_numbers(left, side)]

    caption = _caption(lines, asked, [one.turtle for one in killed])
    return svg.figure(name, "What the turtles drew", caption, draw)


def _caption(lines: Sequence[Line], asked: Sequence[object], killed: Sequence[str]) -> str:
    length_m = sum(line.length_m for line in lines)
    who = listing(dict.fromkeys(line.turtle for line in lines))
    text = f"{who} drew {metres(length_m)}" if lines else "No line is on the canvas"
    if asked:
        noun = "figure" if len(asked) == 1 else "figures"
        text += f"; the dashed {noun} {'was' if len(asked) == 1 else 'were'} asked for"
    if killed:
        text += f"; {counted(len(killed), 'turtle')} killed (marked ×, in order)"
    return f"{text}. The canvas is {SIZE_M:.2f} m wide."


def _line(line: Line, pixel: _Pixel, pixel_size: float) -> Markup:
    points = svg.simplified([pixel(one) for one in line.points], _TOLERANCE_PX)
    path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return svg.element(
        "path",
        d=path,
        class_="turtle-line",
        stroke=_rgb(line.colour),
        stroke_width=max(1.0, line.width * pixel_size),
    )


def _turtle(step: Truth, pixel: _Pixel) -> Iterable[Markup]:
    """Where a turtle is at the end, and where it looks."""
    x, y = pixel((step.x_m, step.y_m))
    cos, sin = math.cos(step.yaw_rad), math.sin(step.yaw_rad)
    corners = [(x + a * cos - b * sin, y - a * sin - b * cos) for a, b in _BODY]
    path = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in corners) + "Z"
    yield svg.element("path", d=path, class_="turtle-body")
    yield svg.label(step.robot, x, y + 22.0, "on-canvas", "middle")


def _beside(x: float, y: float, width: float) -> Point:
    """Where a text beside a mark begins."""
    return (x + 8.0 if x < width - 90.0 else x - 70.0), y + 4.0


def _numbers(left: float, side: float) -> list[Markup]:
    low = side + 8.0 + 16.0
    return [
        svg.label("0", left - 6.0, side + 8.0, "label", "end"),
        svg.label(f"{SIZE_M:.2f} m", left + side, low, "label", "end"),
        svg.label("x", left + side / 2.0, low, "label", "middle"),
        svg.label("y", left - 6.0, 8.0 + side / 2.0, "label", "end"),
    ]


def _rgb(colour: Colour) -> str:
    return f"rgb({colour[0]} {colour[1]} {colour[2]})"
