"""Commands and true speeds over time, with the limits of the robot and what it did."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from typing import NamedTuple

from markupsafe import Markup

from grader.measure.motion.track import REST_M_S, REST_RAD_S
from grader.recording.model import Recording
from grader.recording.simulated import Truth
from grader.report.drawing import axes, svg

STRIP, PANEL, BETWEEN = 18, 110, 34
STRIDE = 4
"""Steps of 10 ms from one drawn point to the next."""
MOST_POINTS = 400
MOST = 1e6
"""Speeds beyond it are not drawn to scale."""
SHORTEST_S = 0.25
"""A phase shorter than this belongs to the one before."""


def draw_motion(recording: Recording, name: str) -> svg.Figure | None:
    """Draw commands and speeds of a run; None in one without a simulated robot."""
    scene = recording.scene
    if scene is None or len(recording.truth) < 2:
        return None
    found = phases(recording)
    stride = max(STRIDE, len(recording.truth) // MOST_POINTS)
    truth = (*recording.truth[::stride], recording.truth[-1])
    times_s = [recording.since_launch_s(step.time_ns) for step in truth]
    forward_m_s = [0.0 if math.isnan(one.command_m_s) else one.command_m_s for one in truth]
    turn_rad_s = [0.0 if math.isnan(one.command_rad_s) else one.command_rad_s for one in truth]
    ahead_m_s = [one.linear_m_s for one in truth]
    turned_rad_s = [one.angular_rad_s for one in truth]
    speeds = (
        _Speed("speed ahead (m/s)", forward_m_s, ahead_m_s, scene.max_linear_m_s),
        _Speed("turn (rad/s)", turn_rad_s, turned_rad_s, scene.max_angular_rad_s),
    )

    def draw(width: float) -> tuple[float, list[Markup]]:
        x = axes.Scale(0.0, max(times_s[-1], 0.1), axes.LEFT, width - axes.RIGHT)
        content, bottom = _strip(found, x), float(STRIP)
        for speed in speeds:
            content += _panel(speed, x.all_clipped(times_s), x.end, bottom + BETWEEN)
            bottom += BETWEEN + PANEL
        return bottom + axes.TIME_AXIS, [*content, *axes.time_axis(x, bottom, width)]

    caption = (
        "Solid: the true speed. Dashed: the command that was in force. Dotted: the limit of the "
        "robot, where it is near. Above: what the robot did."
    )
    described = "; ".join(
        f"{phase.kind} from {phase.begin_s:.1f} to {phase.end_s:.1f} s" for phase in found[:20]
    )
    of = f" of the robot {recording.robot}" if recording.robot else ""
    title = f"Commands and true speeds{of} in the scenario {recording.scenario}"
    return svg.figure(name, title, caption, draw, f"{caption} The robot {described}.")


def phases(recording: Recording) -> list[axes.Bar]:
    """Divide a run into what the robot did, in words."""
    found: list[axes.Bar] = []
    end_s = recording.since_launch_s(recording.truth[0].time_ns)
    for what, group in groupby(recording.truth, key=_what):
        begin_s, end_s = end_s, recording.since_launch_s(list(group)[-1].time_ns)
        if found and (end_s - begin_s < SHORTEST_S or found[-1].kind == what):
            found[-1] = replace(found[-1], end_s=end_s)
        else:
            found.append(axes.Bar(begin_s, end_s, what))
    return found


def _what(step: Truth) -> str:
    drives, turns = abs(step.linear_m_s) > REST_M_S, abs(step.angular_rad_s) > REST_RAD_S
    if drives and turns:
        return "drives and turns"
    return "drives" if drives else "turns" if turns else "rests"


def _strip(found: Sequence[axes.Bar], x: axes.Scale) -> list[Markup]:
    drawn = []
    for phase in found:
        begin, end = x.clipped(phase.begin_s), x.clipped(phase.end_s)
        width = max(1.0, end - begin - 1.5)
        kind = f"phase {phase.kind.replace(' ', '-')}"
        drawn.append(svg.element("rect", x=begin, y=0, width=width, height=STRIP, class_=kind))
        if len(phase.kind) * svg.LETTER + 8 < width:
            drawn.append(svg.label(phase.kind, (begin + end) / 2.0, 13, "on-phase", "middle"))
    return drawn


class _Speed(NamedTuple):
    """One of the two speeds; ``most`` is the limit of the robot."""

    title: str
    commands: Sequence[float]
    true: Sequence[float]
    most: float


def _panel(speed: _Speed, at: Sequence[float], end: float, top: float) -> list[Markup]:
    """Draw a speed; ``at`` are pixels of times."""
    title, commands, true, most = speed
    finite = [value for value in (*commands, *true) if abs(value) < MOST]
    low, high = min(0.0, *finite), max(0.0, *finite)
    reached = ((1.0, high), (-1.0, -low))
    limits = [sign * most for sign, reach in reached if reach > 0.5 * most]
    low, high = min([low, *limits]), max([high, *limits])
    room = 0.08 * (high - low) or 0.05 * most or 0.05
    y = axes.Scale(low - room, high + room, top + PANEL, top)
    # The labels of limits go over the lines, which run through that of the lower limit.
    labels = [
        svg.label(f"limit {one:.3g}{axes.unit_of(title)}", end, y(one) - 4, anchor="end")
        for one in limits
    ]
    return [
        svg.label(title, 0, y.end - 8),
        *axes.value_axis(y, axes.LEFT, end),
        *(svg.line(axes.LEFT, y(one), end, y(one), "limit") for one in limits),
        svg.curve(_steps(at, y.all_clipped(commands)), "command"),
        svg.curve(list(zip(at, y.all_clipped(true), strict=True)), "true"),
        *labels,
    ]


def _steps(times: Sequence[float], values: Sequence[float]) -> list[svg.Point]:
    """Commands as steps, because a command holds until the next one."""
    points: list[svg.Point] = []
    for time, value in zip(times, values, strict=True):
        if points and points[-1][1] != value:
            points.append((time, points[-1][1]))
        points.append((time, value))
    return points
