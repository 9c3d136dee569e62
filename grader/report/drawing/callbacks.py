"""Callbacks as bars: when each of them ran, and which ran at the same time."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from grader.checks.finding import Span
from grader.checks.wording import counted
from grader.report.drawing import axis
from grader.report.drawing.axis import time_axis
from grader.report.drawing.svg import NARROW, WIDE, Figure, Scale, drawing, element, fitted, label
from grader.safe_text import one_line

ROW, BAR = 38, 16
SIDE = 6
MOST_ROWS = 12
LONGEST_S = 1e5
MOST_BARS = 400
"""Bars in a row that are still drawn."""


def draw_callbacks(spans: Sequence[Span], name: str) -> Figure | None:
    """Draw spans of time, a row for each name.

    Args:
        spans: In any order; those that end before they begin or beyond a run are left out.
        name: Unique in the document; letters, digits and hyphens.

    Returns:
        The drawing, or None where there is nothing to draw.
    """
    drawable = [span for span in spans if 0.0 <= span.begin_s <= span.end_s <= LONGEST_S]
    rows: dict[str, list[Span]] = {}
    for span in sorted(drawable, key=lambda item: item.begin_s):
        rows.setdefault(span.name, []).append(span)
    if not rows:
        return None
    shown = dict(list(rows.items())[:MOST_ROWS])
    caption = _caption(rows)
    return Figure(
        caption,
        _draw(shown, caption, f"{name}-wide", WIDE),
        _draw(shown, caption, f"{name}-narrow", NARROW),
    )


def _draw(rows: dict[str, list[Span]], caption: str, name: str, width: float) -> Markup:
    begin_s = min(span.begin_s for spans in rows.values() for span in spans)
    end_s = max(span.end_s for spans in rows.values() for span in spans)
    room = 0.02 * (end_s - begin_s) or 0.05
    x = Scale(max(0.0, begin_s - room), end_s + room, SIDE, width - SIDE)
    content = []
    for index, (row, spans) in enumerate(rows.items()):
        top = index * ROW
        note = _note(spans)
        room_px = width - 2 * SIDE - len(note) * 6.3 - 12
        content += [
            label(fitted(row, room_px), SIDE, top + 12, "lane"),
            label(note, width - SIDE, top + 12, anchor="end"),
            element("rect", x=SIDE, y=top + 18, width=width - 2 * SIDE, height=BAR, class_="track"),
        ]
        content += [_bar(span, x, top + 18) for span in spans[:MOST_BARS]]
    bottom = len(rows) * ROW + 4
    content += time_axis(x, bottom, width)
    return drawing(name, "Callbacks over time", caption, (width, bottom + axis.HEIGHT), content)


def _bar(span: Span, x: Scale, top: float) -> Markup:
    begin, end = x.clipped(span.begin_s), x.clipped(span.end_s)
    return element(
        "rect",
        x=begin,
        y=top,
        width=max(1.5, end - begin),
        height=BAR,
        class_="span wrong" if span.wrong else "span",
    )


def _note(spans: Sequence[Span]) -> str:
    lasted = sorted(span.end_s - span.begin_s for span in spans)
    return f"{counted(len(spans), 'call')}, {lasted[len(lasted) // 2] * 1e3:.0f} ms each"


def _caption(rows: dict[str, list[Span]]) -> str:
    text = "Each bar is one call, from its start to its end."
    wrong = [span for spans in rows.values() for span in spans if span.wrong]
    if wrong:
        names = dict.fromkeys(one_line(span.name) for span in wrong)
        text += f" The outlined ones ({', '.join(names)}) are what the finding is about."
    if len(rows) > MOST_ROWS:
        text += f" {len(rows) - MOST_ROWS} more rows are not drawn."
    return text
