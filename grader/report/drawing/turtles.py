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
"""The background of turtlesim, if no parameter changes it."""
MOST_LINES = 1_000
_TOLERANCE_PX = 0.4
_MARGIN = 26.0
"""Room for the numbers beside the canvas, in pixels."""
_TOP = 8.0
_ToPixel = Callable[[Point], Point]
_BODY = ((9.0, 0.0), (-6.0, 6.0), (-3.0, 0.0), (-6.0, -6.0))
"""Corners of a turtle in pixels: ahead, and to its left."""


def figures(assignment: Assignment, scenario: str) -> tuple[tuple[Point, ...], ...]:
    """The figures that visible checks ask for in a scenario, each once."""
    distinct: dict[tuple[Point, ...], None] = {}
    for check in assignment.checks:
        is_visible = check.visibility is Visibility.VISIBLE
        is_judged = not check.scenarios or scenario in check.scenarios
        if check.uses != "turtle.draws" or not is_judged or not is_visible:
            continue
        with contextlib.suppress(ValidationError):
            parameters = Draws.model_validate(check.with_)
            corners = tuple(parameters.figure)
            distinct[(*corners, corners[0]) if parameters.closed else corners] = None
    return tuple(distinct)


def draw_turtles(
    recording: Recording, asked: Sequence[Sequence[Point]], name: str
) -> svg.Figure | None:
    """Draw the canvas at the end; None in a scenario without turtles."""
    if not recording.turtles:
        return None
    lines = drawn(recording)[-MOST_LINES:]
    killed = [event for event in recording.turtles if event.kind == "killed"]
    killed_names = [event.turtle for event in killed]
    last_steps = {step.robot: step for step in recording.truth}
    alive = [step for step in last_steps.values() if step.robot not in killed_names]

    def draw(width: float) -> tuple[float, list[Markup]]:
        side = min(width - 2.0 * _MARGIN, 420.0)
        left, scale = (width - side) / 2.0, side / SIZE_M

        def pixel(place: Point) -> Point:
            # What is drawn beyond the walls ends there.
            x_m, y_m = (min(max(value, 0.0), SIZE_M) for value in place)
            return left + x_m * scale, _TOP + (SIZE_M - y_m) * scale

        fill = _rgb(_background(recording))
        canvas = [
            svg.element("rect", x=left, y=_TOP, width=side, height=side, fill=fill),
            *(_line(line, pixel, side / PIXELS) for line in lines),
            *(svg.curve([pixel(corner) for corner in figure], "turtle-asked") for figure in asked),
        ]
        marks = [mark for step in alive for mark in _turtle(step, pixel)]
        for number, event in enumerate(killed, start=1):
            x, y = pixel((event.x_m, event.y_m))
            text_x = x + 8.0 if x < width - 90.0 else x - 70.0
            marks.append(svg.crosses([(x, y)], "turtle-mark"))
            marks.append(svg.label(f"{number}. {event.turtle}", text_x, y + 4.0, "on-canvas"))
        numbers = _numbers(left, side)
        return side + _TOP + _MARGIN, [svg.element("g", *canvas), *marks, *numbers]

    caption = _caption(lines, asked, killed_names)
    return svg.figure(name, "What the turtles drew", caption, draw)


def _background(recording: Recording) -> Colour:
    """The colour below the lines at the end."""
    colours = [event.colour for event in recording.turtles if event.kind == "background"]
    return colours[-1] if colours else BACKGROUND


def _caption(lines: Sequence[Line], asked: Sequence[object], killed: Sequence[str]) -> str:
    text = "No line is on the canvas"
    if lines:
        turtles = listing(dict.fromkeys(line.turtle for line in lines))
        text = f"{turtles} drew {metres(sum(line.length_m for line in lines))}"
    if len(asked) == 1:
        text += "; the dashed figure was asked for"
    elif asked:
        text += "; the dashed figures were asked for"
    if killed:
        text += f"; {counted(len(killed), 'turtle')} killed (marked ×, in order)"
    return f"{text}. The canvas is {SIZE_M:.2f} m wide."


def _line(line: Line, pixel: _ToPixel, pixel_size: float) -> Markup:
    points = svg.simplified([pixel(place) for place in line.points], _TOLERANCE_PX)
    path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return svg.element(
        "path",
        d=path,
        class_="turtle-line",
        stroke=_rgb(line.colour),
        stroke_width=max(1.0, line.width * pixel_size),
    )


def _turtle(step: Truth, pixel: _ToPixel) -> Iterable[Markup]:
    """Where a turtle is at the end, and where it looks."""
    x, y = pixel((step.x_m, step.y_m))
    cos, sin = math.cos(step.yaw_rad), math.sin(step.yaw_rad)
    corners = [
        (x + ahead * cos - aside * sin, y - ahead * sin - aside * cos) for ahead, aside in _BODY
    ]
    path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in corners) + "Z"
    yield svg.element("path", d=path, class_="turtle-body")
    yield svg.label(step.robot, x, y + 22.0, "on-canvas", "middle")


def _numbers(left: float, side: float) -> list[Markup]:
    """The size of the canvas beside its edges."""
    bottom = _TOP + side
    return [
        svg.label("0", left - 6.0, bottom, "label", "end"),
        svg.label(f"{SIZE_M:.2f} m", left + side, bottom + 16.0, "label", "end"),
        svg.label("x", left + side / 2.0, bottom + 16.0, "label", "middle"),
        svg.label("y", left - 6.0, _TOP + side / 2.0, "label", "end"),
    ]


def _rgb(colour: Colour) -> str:
    return f"rgb({colour[0]} {colour[1]} {colour[2]})"
