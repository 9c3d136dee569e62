"""The time axis that the drawings of a run share."""

from __future__ import annotations

from markupsafe import Markup

from grader.report.drawing.svg import NARROW, Scale, label, line, ticks

HEIGHT = 40
"""Pixels below the axis line that its labels take."""


def time_axis(scale: Scale, y: float, width: float) -> list[Markup]:
    """Draw seconds since launch along the bottom.

    Args:
        scale: Seconds to pixels.
        y: Pixel of the line.
    """
    drawn = [line(scale.begin, y, scale.end, y, "axis")]
    for value, text in ticks(scale.low, scale.high, 10 if width > NARROW else 5):
        x = scale(value)
        anchor = "start" if x < 20 else "end" if x > width - 20 else "middle"
        drawn.append(line(x, y, x, y + 5, "axis"))
        drawn.append(label(text, x, y + 18, anchor=anchor))
    drawn.append(label("time since launch (s)", scale.end, y + 34, anchor="end"))
    return drawn
