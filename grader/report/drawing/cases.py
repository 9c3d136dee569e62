"""Errors of many cases against a limit, on a logarithmic scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from markupsafe import Markup

from grader.findings.finding import Case, Cases
from grader.findings.words import counted
from grader.report.drawing import svg
from grader.report.drawing.axes import RIGHT, Scale, unit_of, value_axis
from grader.spec.safe_text import one_line

HEIGHT, LEFT, TOP, BOTTOM = 250, 62, 26, 42
FLOOR = 1e-9
"""Smaller errors are drawn here: noise of the arithmetic."""
CEILING = 1e9


def draw_cases(cases: Cases, name: str) -> svg.Figure:
    """Draw the error of each case."""
    errors = [_power_of(case.error) for case in cases.cases if case.error is not None]
    limit = _power_of(cases.limit)
    low = math.floor(min([*errors, limit]))
    high = math.ceil(max([*errors, limit]) + 1e-9)
    y = Scale(low, high + (low == high), HEIGHT - BOTTOM, TOP)
    every = max(1, math.ceil((y.high - y.low) / 6))
    powers = [
        (power, f"{10.0**power:g}".replace("e-0", "e-").replace("e+0", "e+"))
        for power in range(low, int(y.high) + 1, every)
    ]
    of_limit = f"{cases.limit:g}{unit_of(cases.label)}"

    def draw(width: float) -> tuple[float, list[Markup]]:
        x = Scale(0.5, max(1, len(cases.cases)) + 0.5, LEFT, width - RIGHT)
        at, span = y(limit), {"x": LEFT, "width": x.end - LEFT}
        return HEIGHT, [
            svg.label(cases.label, 0, 12),
            svg.label("case", x.end, HEIGHT - 4, anchor="end"),
            svg.element("rect", y=at, height=y.begin - at, class_="band", **span),
            *value_axis(y, LEFT, x.end, powers),
            *_groups(cases.cases, x, y),
            svg.line(LEFT, at, x.end, at, "band-edge"),
            svg.line(LEFT, y.begin, x.end, y.begin, "axis"),
            *_marks(cases, x, y),
            svg.label(f"limit {of_limit}", x.end, at - 5, anchor="end"),
        ]

    return svg.figure(name, cases.title, _caption(cases, of_limit), draw)


def _marks(cases: Cases, x: Scale, y: Scale) -> list[Markup]:
    good: list[svg.Point] = []
    bad: list[svg.Point] = []
    drawn: list[Markup] = []
    for index, case in enumerate(cases.cases, 1):
        if case.error is None:
            drawn.append(svg.label("?", x(index), TOP + 9, "missing", "middle"))
            continue
        point = x(index), y.clipped(_power_of(case.error))
        (bad if _is_wrong(case, cases.limit) else good).append(point)
    if good:
        drawn.append(svg.dots(good, "dots"))
    if bad:
        drawn.append(svg.crosses(bad, "out"))
    return drawn


def _groups(cases: Sequence[Case], x: Scale, y: Scale) -> list[Markup]:
    """Where one kind of cases ends, and its name where it has room."""
    drawn, first = [], 0
    for group, members in groupby(cases, key=lambda case: case.group):
        last = first + len(list(members))
        if first:
            drawn.append(svg.line(x(first + 0.5), y.end, x(first + 0.5), y.begin, "leader"))
        text = one_line(group)
        if len(text) * svg.LETTER < x(last) - x(first):
            centre = (x(first + 0.5) + x(last + 0.5)) / 2.0
            drawn.append(svg.label(text, centre, y.begin + 18, anchor="middle"))
        first = last
    return drawn


def _is_wrong(case: Case, limit: float) -> bool:
    return case.error is None or not case.error <= limit


def _power_of(error: float) -> float:
    return math.log10(CEILING if math.isnan(error) else min(max(abs(error), FLOOR), CEILING))


def _caption(cases: Cases, limit: str) -> str:
    found = [case for case in cases.cases if _is_wrong(case, cases.limit)]
    missing = sum(case.error is None for case in found)
    wrong = len(found) - missing
    parts = [f"{one_line(cases.title)}: {counted(len(cases.cases), 'case')}"]
    if wrong:
        parts.append(f"{wrong} beyond the limit of {limit} (marked ×)")
    if missing:
        parts.append(f"{missing} without an answer (marked ?)")
    if found:
        kinds = dict.fromkeys(one_line(case.group) for case in found)
        parts.append(f"of the kind {', '.join(kinds)}")
    else:
        parts.append(f"all within the limit of {limit} (shaded)")
    return f"{', '.join(parts)}. The scale is logarithmic."
