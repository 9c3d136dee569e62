"""Commands and true speeds over time, with the limits of the robot and what it did."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby

from markupsafe import Markup

from grader.measure.motion.track import REST_M_S, REST_RAD_S
from grader.recording.model import Recording
from grader.recording.simulated import Scene, Truth
from grader.report.drawing import axis
from grader.report.drawing.axis import time_axis
from grader.report.drawing.svg import (
    LETTER,
    NARROW,
    WIDE,
    Figure,
    Point,
    Scale,
    curve,
    drawing,
    element,
    label,
    line,
    outline,
    ticks,
    unit_of,
)

LEFT, RIGHT = 54, 12
STRIP, PANEL, BETWEEN = 18, 110, 34
STRIDE = 4
"""Steps of 10 ms from one drawn point to the next."""
MOST_POINTS = 400
MOST = 1e6
"""Speeds beyond it are not drawn to scale."""
SHORTEST_S = 0.25
"""A phase shorter than this belongs to the one before."""
PHASES = {
    "rests": "phase rests",
    "drives": "phase drives",
    "turns": "phase turns",
    "drives and turns": "phase drives-and-turns",
}


@dataclass(frozen=True)
class Phase:
    """What the robot did for a while; times in seconds since launch."""

    what: str
    begin_s: float
    end_s: float


@dataclass(frozen=True)
class _Panel:
    """One of the two speeds, drawn as high in every width.

    Attributes:
        command: What was commanded and in force: times (s since launch) and vertical pixels.
    """

    title: str
    y: Scale
    limits: Sequence[tuple[float, str]]
    command: Sequence[Point]
    true: Sequence[Point]


def draw_motion(recording: Recording, name: str) -> Figure | None:
    """Draw commands and speeds of a run.

    Args:
        name: Unique in the document; letters, digits and hyphens.

    Returns:
        The drawing, or None in a scenario without a simulated robot.
    """
    scene = recording.scene
    if scene is None or len(recording.truth) < 2:
        return None
    found = phases(recording)
    caption = (
        "Solid: the true speed. Dashed: the command that was in force. Dotted: the limit of the "
        "robot, where it is near. Above: what the robot did."
    )
    described = "; ".join(
        f"{phase.what} from {phase.begin_s:.1f} to {phase.end_s:.1f} s" for phase in found[:20]
    )
    description = f"{caption} The robot {described}."
    stride = max(STRIDE, len(recording.truth) // MOST_POINTS)
    truth = (*recording.truth[::stride], recording.truth[-1])
    times_s = [recording.since_launch_s(step.time_ns) for step in truth]
    panels = _panels(truth, scene, times_s)
    title = f"Commands and true speeds in the scenario {recording.scenario}"
    wide, narrow = (
        drawing(f"{name}-{kind}", title, description, *_draw(panels, times_s, found, width))
        for kind, width in (("wide", WIDE), ("narrow", NARROW))
    )
    return Figure(caption, wide, narrow)


def phases(recording: Recording) -> tuple[Phase, ...]:
    """Divide a run into what the robot did."""
    found: list[Phase] = []
    for what, group in groupby(recording.truth, key=_what):
        steps = list(group)
        end_s = recording.since_launch_s(steps[-1].time_ns)
        begin_s = found[-1].end_s if found else recording.since_launch_s(steps[0].time_ns)
        found.append(Phase(what, begin_s, end_s))
    merged: list[Phase] = []
    for phase in found:
        short = phase.end_s - phase.begin_s < SHORTEST_S
        if merged and (short or merged[-1].what == phase.what):
            merged[-1] = Phase(merged[-1].what, merged[-1].begin_s, phase.end_s)
        else:
            merged.append(phase)
    return tuple(merged)


def _what(step: Truth) -> str:
    drives, turns = abs(step.linear_m_s) > REST_M_S, abs(step.angular_rad_s) > REST_RAD_S
    if drives and turns:
        return "drives and turns"
    return "drives" if drives else "turns" if turns else "rests"


def _panels(truth: Sequence[Truth], scene: Scene, times_s: Sequence[float]) -> list[_Panel]:
    speeds = (
        (
            "speed ahead (m/s)",
            [0.0 if math.isnan(step.command_m_s) else step.command_m_s for step in truth],
            [step.linear_m_s for step in truth],
            scene.max_linear_m_s,
        ),
        (
            "turn (rad/s)",
            [0.0 if math.isnan(step.command_rad_s) else step.command_rad_s for step in truth],
            [step.angular_rad_s for step in truth],
            scene.max_angular_rad_s,
        ),
    )
    panels: list[_Panel] = []
    for title, commands, true, limit in speeds:
        top = STRIP + BETWEEN + len(panels) * (PANEL + BETWEEN)
        near = _near(limit, (*commands, *true))
        y = _scale((*commands, *true), near, limit, top)
        told = [(value, f"limit {value:.3g}{unit_of(title)}") for value in near]
        held = _steps(times_s, y.all_clipped(commands))
        driven = list(zip(times_s, y.all_clipped(true), strict=True))
        panels.append(_Panel(title, y, told, _seen(held, times_s), _seen(driven, times_s)))
    return panels


def _near(limit: float, values: Iterable[float]) -> list[float]:
    """The limits, ahead and back, that the values reach half of."""
    finite = [value for value in values if abs(value) < MOST]
    low, high = min(0.0, *finite), max(0.0, *finite)
    return [sign * limit for sign, reach in ((1.0, high), (-1.0, -low)) if reach > 0.5 * limit]


def _scale(values: Iterable[float], limits: Iterable[float], limit: float, top: float) -> Scale:
    finite = [value for value in values if abs(value) < MOST]
    low, high = min(0.0, *finite, *limits), max(0.0, *finite, *limits)
    room = 0.08 * (high - low) or 0.05 * limit or 0.05
    return Scale(low - room, high + room, top + PANEL, top)


def _seen(points: Sequence[Point], times_s: Sequence[float]) -> list[Point]:
    """Of times and vertical pixels, those that can be seen in the wide drawing."""
    x = _time_scale(times_s, WIDE)
    placed = zip(x.all_clipped([time_s for time_s, _ in points]), points, strict=True)
    return [points[index] for index in outline([(x, y) for x, (_, y) in placed])]


def _time_scale(times_s: Sequence[float], width: float) -> Scale:
    return Scale(0.0, max(times_s[-1], 0.1), LEFT, width - RIGHT)


def _draw(
    panels: Sequence[_Panel], times_s: Sequence[float], found: Sequence[Phase], width: float
) -> tuple[tuple[float, float], list[Markup]]:
    """Size and content of the drawing."""
    x = _time_scale(times_s, width)
    content = _strip(found, x)
    for panel in panels:
        content += _panel(panel, x)
    bottom = panels[-1].y.begin
    content += time_axis(x, bottom, width)
    return (width, bottom + axis.HEIGHT), content


def _strip(found: Sequence[Phase], x: Scale) -> list[Markup]:
    drawn = []
    for phase in found:
        begin, end = x.clipped(phase.begin_s), x.clipped(phase.end_s)
        width = max(1.0, end - begin - 1.5)
        drawn.append(
            element("rect", x=begin, y=0, width=width, height=STRIP, class_=PHASES[phase.what])
        )
        if len(phase.what) * LETTER + 8 < width:
            drawn.append(label(phase.what, (begin + end) / 2.0, 13, "on-phase", "middle"))
    return drawn


def _panel(panel: _Panel, x: Scale) -> list[Markup]:
    y = panel.y
    drawn = [label(panel.title, 0, y.end - 8)]
    for value, text in ticks(y.low, y.high, 4):
        drawn.append(line(LEFT, y(value), x.end, y(value), "grid"))
        drawn.append(label(text, LEFT - 8, y(value) + 4, anchor="end"))
    for limit, _ in panel.limits:
        drawn.append(line(LEFT, y(limit), x.end, y(limit), "limit"))
    drawn.append(curve([(x(time_s), at) for time_s, at in panel.command], "command"))
    drawn.append(curve([(x(time_s), at) for time_s, at in panel.true], "true"))
    # Over the lines, which run through the label of the lower limit.
    for limit, text in panel.limits:
        drawn.append(label(text, x.end, y(limit) - 4, anchor="end"))
    return drawn


def _steps(times: Sequence[float], values: Sequence[float]) -> list[Point]:
    """A command holds until the next: no slopes between two."""
    points: list[Point] = []
    for time, value in zip(times, values, strict=True):
        if points and points[-1][1] != value:
            points.append((time, points[-1][1]))
        points.append((time, value))
    return points
