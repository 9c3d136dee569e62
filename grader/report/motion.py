"""Commands and true speeds over time, with the limits of the robot and what it did."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from grader.checks.track import REST_M_S, REST_RAD_S
from grader.recording.model import Recording, Scene, Truth
from grader.report import axis
from grader.report.axis import time_axis
from grader.report.svg import (
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
    ticks,
)

LEFT, RIGHT = 54, 12
STRIP, PANEL, BETWEEN = 18, 110, 34
STRIDE = 4
"""Steps of 10 ms from one drawn point to the next."""
MOST_POINTS = 400
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
    """One of the two speeds.

    Attributes:
        title: What it is.
        unit: Its unit.
        command: What was commanded and in force.
        true: What it was.
        limit: Of the robot.
    """

    title: str
    unit: str
    command: Callable[[Truth], float]
    true: Callable[[Truth], float]
    limit: float


def draw_motion(recording: Recording, name: str) -> Figure | None:
    """Draw commands and speeds of a run.

    Args:
        recording: The run.
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
    return Figure(
        caption,
        _draw(recording, scene, found, description, f"{name}-wide", WIDE),
        _draw(recording, scene, found, description, f"{name}-narrow", NARROW),
    )


def phases(recording: Recording) -> tuple[Phase, ...]:
    """Divide a run into what the robot did."""
    found: list[Phase] = []
    for step in recording.truth:
        time_s = recording.since_launch_s(step.time_ns)
        what = _what(step)
        if found and found[-1].what == what:
            found[-1] = Phase(what, found[-1].begin_s, time_s)
        else:
            found.append(Phase(what, found[-1].end_s if found else time_s, time_s))
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


def _draw(
    recording: Recording,
    scene: Scene,
    found: Sequence[Phase],
    description: str,
    name: str,
    width: float,
) -> Markup:
    stride = max(STRIDE, len(recording.truth) // MOST_POINTS)
    truth = (*recording.truth[::stride], recording.truth[-1])
    since = recording.since_launch_s
    x = Scale(0.0, max(since(truth[-1].time_ns), 0.1), LEFT, width - RIGHT)
    panels = (
        _Panel(
            "speed ahead",
            "m/s",
            lambda step: step.command_m_s,
            lambda step: step.linear_m_s,
            scene.max_linear_m_s,
        ),
        _Panel(
            "turn",
            "rad/s",
            lambda step: step.command_rad_s,
            lambda step: step.angular_rad_s,
            scene.max_angular_rad_s,
        ),
    )
    content = _strip(found, x)
    top: float = STRIP + BETWEEN
    for panel in panels:
        content += _panel(panel, truth, since, x, top)
        top += PANEL + BETWEEN
    bottom = top - BETWEEN
    content += time_axis(x, bottom, width)
    title = f"Commands and true speeds in the scenario {recording.scenario}"
    return drawing(name, title, description, (width, bottom + axis.HEIGHT), content)


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


def _panel(
    panel: _Panel, truth: Sequence[Truth], since: Callable[[int], float], x: Scale, top: float
) -> list[Markup]:
    commands = [0.0 if math.isnan(panel.command(step)) else panel.command(step) for step in truth]
    true = [panel.true(step) for step in truth]
    finite = [value for value in (*commands, *true) if abs(value) < 1e6]
    low, high = min(0.0, *finite), max(0.0, *finite)
    near = 0.5 * panel.limit
    limits = [sign * panel.limit for sign, reach in ((1.0, high), (-1.0, -low)) if reach > near]
    low, high = min(low, *limits, 0.0), max(high, *limits, 0.0)
    room = 0.08 * (high - low) or 0.05 * panel.limit or 0.05
    y = Scale(low - room, high + room, top + PANEL, top)
    drawn = [label(f"{panel.title} ({panel.unit})", 0, top - 8)]
    for value, text in ticks(y.low, y.high, 3):
        drawn.append(line(LEFT, y(value), x.end, y(value), "grid"))
        drawn.append(label(text, LEFT - 8, y(value) + 4, anchor="end"))
    for limit in limits:
        drawn.append(line(LEFT, y(limit), x.end, y(limit), "limit"))
        drawn.append(label(f"limit {limit:.3g} {panel.unit}", x.end, y(limit) - 4, anchor="end"))
    times = [x(since(step.time_ns)) for step in truth]
    drawn.append(curve(_steps(times, [y.clipped(value) for value in commands]), "command"))
    drawn.append(curve(list(zip(times, map(y.clipped, true), strict=True)), "true"))
    return drawn


def _steps(times: Sequence[float], values: Sequence[float]) -> list[Point]:
    """A command holds until the next: no slopes between two."""
    points: list[Point] = []
    for time, value in zip(times, values, strict=True):
        if points and points[-1][1] != value:
            points.append((time, points[-1][1]))
        points.append((time, value))
    return points
