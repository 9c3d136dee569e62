"""Errors of many cases against a limit, on a logarithmic scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from markupsafe import Markup

from grader.checks.finding import Case, Cases
from grader.checks.wording import counted
from grader.report.drawing.svg import (
    LETTER,
    NARROW,
    WIDE,
    Figure,
    Point,
    Scale,
    crosses,
    dots,
    drawing,
    element,
    label,
    line,
    unit_of,
)
from grader.safe_text import one_line

HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 250, 62, 12, 26, 42
FLOOR = 1e-9
"""Smaller errors are drawn here: noise of the arithmetic."""
CEILING = 1e9


def draw_cases(cases: Cases, name: str) -> Figure:
    """Draw the error of each case.

    Args:
        name: Unique in the document; letters, digits and hyphens.
    """
    caption = _caption(cases)
    return Figure(
        caption,
        _draw(cases, caption, f"{name}-wide", WIDE),
        _draw(cases, caption, f"{name}-narrow", NARROW),
    )


def _draw(cases: Cases, caption: str, name: str, width: float) -> Markup:
    errors = [_clipped(case.error) for case in cases.cases if case.error is not None]
    limit = _clipped(cases.limit)
    low = math.floor(math.log10(min([*errors, limit])))
    high = math.ceil(math.log10(max([*errors, limit])) + 1e-9)
    y = Scale(low, high + (low == high), HEIGHT - BOTTOM, TOP)
    x = Scale(0.5, max(1, len(cases.cases)) + 0.5, LEFT, width - RIGHT)
    limit_y = y(math.log10(limit))
    content = [
        label(cases.label, 0, 12),
        label("case", x.end, HEIGHT - 4, anchor="end"),
        element(
            "rect", x=LEFT, y=limit_y, width=x.end - LEFT, height=y.begin - limit_y, class_="band"
        ),
    ]
    every = max(1, math.ceil((y.high - y.low) / 6))
    for power in range(int(y.low), int(y.high) + 1, every):
        content.append(line(LEFT, y(power), x.end, y(power), "grid"))
        content.append(label(_power(power), LEFT - 8, y(power) + 4, anchor="end"))
    content += _groups(cases.cases, x, y)
    content.append(line(LEFT, limit_y, x.end, limit_y, "band-edge"))
    content.append(line(LEFT, y.begin, x.end, y.begin, "axis"))
    content += _marks(cases, x, y)
    content.append(
        label(f"limit {cases.limit:g}{unit_of(cases.label)}", x.end, limit_y - 5, anchor="end")
    )
    return drawing(name, cases.title, caption, (width, HEIGHT), content)


def _marks(cases: Cases, x: Scale, y: Scale) -> list[Markup]:
    good: list[Point] = []
    bad: list[Point] = []
    drawn: list[Markup] = []
    for index, case in enumerate(cases.cases, 1):
        if case.error is None:
            drawn.append(label("?", x(index), TOP + 9, "missing", "middle"))
            continue
        point = x(index), y.clipped(math.log10(_clipped(case.error)))
        (bad if _is_wrong(case, cases.limit) else good).append(point)
    if good:
        drawn.append(dots(good, "dots"))
    if bad:
        drawn.append(crosses(bad, "out"))
    return drawn


def _groups(cases: Sequence[Case], x: Scale, y: Scale) -> list[Markup]:
    """Where one kind of cases ends, and its name where it has room."""
    drawn, first = [], 0
    for group, members in groupby(cases, key=lambda case: case.group):
        last = first + len(list(members))
        if first:
            drawn.append(line(x(first + 0.5), y.end, x(first + 0.5), y.begin, "leader"))
        text = one_line(group)
        if len(text) * LETTER < x(last) - x(first):
            centre = (x(first + 0.5) + x(last + 0.5)) / 2.0
            drawn.append(label(text, centre, y.begin + 18, anchor="middle"))
        first = last
    return drawn


def _is_wrong(case: Case, limit: float) -> bool:
    return case.error is None or not case.error <= limit


def _clipped(error: float) -> float:
    return CEILING if math.isnan(error) else min(max(abs(error), FLOOR), CEILING)


def _power(power: int) -> str:
    return f"{10.0**power:g}".replace("e-0", "e-").replace("e+0", "e+")


def _caption(cases: Cases) -> str:
    limit = f"{cases.limit:g}{unit_of(cases.label)}"
    missing = sum(case.error is None for case in cases.cases)
    wrong = sum(_is_wrong(case, cases.limit) for case in cases.cases) - missing
    parts = [f"{one_line(cases.title)}: {counted(len(cases.cases), 'case')}"]
    if wrong:
        parts.append(f"{wrong} beyond the limit of {limit} (marked ×)")
    if missing:
        parts.append(f"{missing} without an answer (marked ?)")
    if not wrong and not missing:
        parts.append(f"all within the limit of {limit} (shaded)")
    groups = dict.fromkeys(
        one_line(case.group) for case in cases.cases if _is_wrong(case, cases.limit)
    )
    if groups:
        parts.append(f"of the kind {', '.join(groups)}")
    return f"{', '.join(parts)}. The scale is logarithmic."
