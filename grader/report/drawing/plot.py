"""The plot of a finding: points over time, and the band that is allowed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from operator import not_

from markupsafe import Markup

from grader.checks.finding import Plot
from grader.checks.wording import counted
from grader.report.drawing.histogram import bars
from grader.report.drawing.svg import (
    NARROW,
    WIDE,
    Figure,
    Point,
    Scale,
    crosses,
    curve,
    dots,
    drawing,
    element,
    label,
    line,
    outline,
    ticks,
    unit_of,
)
from grader.safe_text import one_line

HEIGHT = 232
LEFT, RIGHT, TOP, BOTTOM = 54, 12, 26, 42
DRAWABLE = 1e15
"""Beyond this a double cannot tell neighbouring pixels apart."""
MANY = 600
"""Points that are still all looked at."""
ASIDE, GAP = 0.2, 14
"""Share of the width that a histogram takes, and the pixels before it."""
APART = 5.0
"""Pixels between two crosses that are still told apart."""
DOTS = 120
"""Points that are still told apart; more are a line."""


def draw_plot(plot: Plot, name: str) -> Figure:
    """Draw a plot.

    Args:
        plot: Its values; those that are not finite are left out, and the caption says so.
        name: Unique in the document; letters, digits and hyphens.
    """
    points = [
        (x, y)
        for x, y in zip(plot.x, plot.y, strict=False)
        if abs(x) < DRAWABLE and abs(y) < DRAWABLE
    ]
    lost = max(len(plot.x), len(plot.y)) - len(points)
    band = plot.band if plot.band and not any(math.isnan(edge) for edge in plot.band) else None
    edges = [edge for edge in band or () if abs(edge) < DRAWABLE]
    ordinates = [y for _, y in points]
    low, high = band or (-math.inf, math.inf)
    inside = [low <= y <= high for y in ordinates]
    wide = _abscissae(plot, points, WIDE)
    kept = _thinned(points, wide) if len(points) > MANY else [*range(len(points))]
    shown = [points[index] for index in kept]
    y = Scale(*_span(ordinates + edges, 0.1), HEIGHT - BOTTOM, TOP)
    values = _Values(
        points=points,
        shown=shown,
        inside=[inside[index] for index in kept],
        outside=inside.count(False),
        y=y,
        edges=edges,
        course=[shown[index] for index in outline(_placed(shown, wide, y))] if shown else [],
    )
    caption = _caption(plot, values, band, lost)
    return Figure(
        caption,
        _draw(plot, values, band, caption, f"{name}-wide", WIDE),
        _draw(plot, values, band, caption, f"{name}-narrow", NARROW),
    )


@dataclass(frozen=True)
class _Values:
    """What is to be drawn, whatever the width.

    Attributes:
        course: Of the shown points, those that a line through them needs in the wide drawing.
    """

    points: Sequence[Point]
    shown: Sequence[Point]
    inside: Sequence[bool]
    outside: int
    y: Scale
    edges: Sequence[float]
    course: Sequence[Point]


def _abscissae(plot: Plot, points: Sequence[Point], width: float) -> Scale:
    """The scale along a drawing, which leaves room for a histogram."""
    aside = width * ASIDE if plot.histogram and points else 0.0
    return Scale(*_span([x for x, _ in points], 0.0), LEFT, width - RIGHT - aside)


def _placed(points: Sequence[Point], x: Scale, y: Scale) -> list[Point]:
    """Points in pixels."""
    across, down = x.all_clipped([a for a, _ in points]), y.all_clipped([b for _, b in points])
    return list(zip(across, down, strict=True))


def _draw(
    plot: Plot, values: _Values, band: Point | None, caption: str, name: str, width: float
) -> Markup:
    y = values.y
    x = _abscissae(plot, values.points, width)
    end = width - RIGHT
    content = [
        label(plot.y_label, 0, 12),
        label(plot.x_label, x.end, HEIGHT - 4, anchor="end"),
    ]
    if band:
        top, bottom = y.clipped(band[1]), y.clipped(band[0])
        height = max(1.0, bottom - top)
        content.append(
            element("rect", x=LEFT, y=top, width=end - LEFT, height=height, class_="band")
        )
        content += [line(LEFT, y(edge), end, y(edge), "band-edge") for edge in values.edges]
    for value, text in ticks(y.low, y.high, 4):
        content.append(line(LEFT, y(value), end, y(value), "grid"))
        content.append(label(text, LEFT - 8, y(value) + 4, anchor="end"))
    content.append(line(LEFT, y.begin, end, y.begin, "axis"))
    for value, text in ticks(x.low, x.high, 8 if width > NARROW else 3):
        content.append(line(x(value), y.begin, x(value), y.begin + 5, "axis"))
        content.append(label(text, x(value), y.begin + 18, anchor="middle"))
    content += _series(values, x)
    if plot.histogram and values.points:
        content += bars([y for _, y in values.points], y, x.end + GAP, end)
        content.append(label("how many", end, HEIGHT - 4, anchor="end"))
    return drawing(name, plot.title, caption, (width, HEIGHT), content)


def _series(values: _Values, x: Scale) -> list[Markup]:
    dense = len(values.shown) > DOTS
    drawn = []
    placed = _placed(values.shown, x, values.y)
    if len(placed) > 1:
        course = _placed(values.course, x, values.y)
        drawn.append(curve(course, "series dense" if dense else "series"))
    if any(values.inside) and not dense:
        drawn.append(dots(compress(placed, values.inside), "dots"))
    if not all(values.inside):
        drawn.append(crosses(_apart([*compress(placed, map(not_, values.inside))]), "out"))
    return drawn


def _apart(points: Sequence[Point]) -> list[Point]:
    """Points that are still told apart as crosses; the last of a run always stays."""
    kept: list[Point] = []
    for point in points:
        if len(kept) > 1 and math.dist(kept[-2], point) < APART:
            kept.pop()
        kept.append(point)
    return kept


def _thinned(points: Sequence[Point], x: Scale) -> list[int]:
    """Indices of the lowest and the highest point of every pixel column, by abscissa."""
    lowest: dict[int, int] = {}
    highest: dict[int, int] = {}
    for index, (column, (_, y)) in enumerate(
        zip(map(round, x.all_clipped([a for a, _ in points])), points, strict=True)
    ):
        if y < points[lowest.setdefault(column, index)][1]:
            lowest[column] = index
        if y > points[highest.setdefault(column, index)][1]:
            highest[column] = index
    return sorted({*lowest.values(), *highest.values()}, key=lambda index: points[index])


def _span(values: Sequence[float], margin: float) -> tuple[float, float]:
    """Lowest and highest value with a margin, never empty."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    size = max(abs(low), abs(high))
    if high - low > max(1e-9 * size, 1e-12):
        room = (high - low) * margin
    else:
        room = 0.05 * size if size > 1e-9 else 0.5
    return low - room, high + room


def _caption(plot: Plot, values: _Values, band: Point | None, lost: int) -> str:
    parts = [one_line(plot.title)]
    count = len(values.points)
    if not count:
        parts.append("no values")
    elif band:
        outside = values.outside
        parts.append(f"{_allowed(band)}{unit_of(plot.y_label)} (shaded)")
        parts.append(
            f"{outside} of {count} outside (marked ×)" if outside else f"all {count} inside"
        )
    else:
        parts.append(counted(count, "value"))
    if lost:
        parts.append(f"{lost} without a finite value not drawn")
    return f"{parts[0]}: {', '.join(parts[1:])}."


def _allowed(band: Point) -> str:
    low, high = band
    if math.isinf(low):
        return f"allowed up to {high:.6g}"
    if math.isinf(high):
        return f"allowed from {low:.6g}"
    return f"allowed {low:.6g} to {high:.6g}"
