"""Callbacks as bars: when each of them ran, and which ran at the same time."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median_high

from markupsafe import Markup

from grader.findings.finding import Span
from grader.findings.words import counted
from grader.report.drawing import axes
from grader.report.drawing.svg import Figure, figure
from grader.spec.safe_text import one_line

MOST_ROWS = 12
LONGEST_S = 1e5
MOST_BARS = 400
"""Bars in a row that are still drawn."""


def draw_callbacks(spans: Sequence[Span], name: str) -> Figure | None:
    """Draw spans of time, a row for each name; None where there is nothing to draw.

    Those that end before they begin or beyond a run are left out.
    """
    rows: dict[str, list[Span]] = {}
    for span in sorted(spans, key=lambda item: item.begin_s):
        if 0.0 <= span.begin_s <= span.end_s <= LONGEST_S:
            rows.setdefault(span.name, []).append(span)
    if not rows:
        return None
    shown = list(rows.values())[:MOST_ROWS]
    begin_s = min(calls[0].begin_s for calls in shown)
    end_s = max(call.end_s for calls in shown for call in calls)
    room_s = 0.02 * (end_s - begin_s) or 0.05
    lanes = [_lane(calls) for calls in shown]
    bottom = axes.LANE * len(lanes) + 4

    def draw(width: float) -> tuple[float, list[Markup]]:
        x = axes.Scale(max(0.0, begin_s - room_s), end_s + room_s, axes.SIDE, width - axes.SIDE)
        return bottom + axes.TIME_AXIS, [
            *axes.draw_lanes(lanes, x, 0, width),
            *axes.time_axis(x, bottom, width),
        ]

    return figure(name, "Callbacks over time", _caption(rows), draw)


def _lane(calls: Sequence[Span]) -> axes.Lane:
    lasted_ms = median_high(call.end_s - call.begin_s for call in calls) * 1e3
    return axes.Lane(
        calls[0].name,
        f"{counted(len(calls), 'call')}, {lasted_ms:.0f} ms each",
        [
            axes.Bar(call.begin_s, call.end_s, "span wrong" if call.wrong else "span")
            for call in calls[:MOST_BARS]
        ],
    )


def _caption(rows: dict[str, list[Span]]) -> str:
    text = "Each bar is one call, from its start to its end."
    wrong = [name for name, calls in rows.items() if any(call.wrong for call in calls)]
    if wrong:
        names = ", ".join(map(one_line, wrong))
        text += f" The outlined ones ({names}) are what the finding is about."
    if len(rows) > MOST_ROWS:
        text += f" {len(rows) - MOST_ROWS} more rows are not drawn."
    return text
