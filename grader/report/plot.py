"""The plot of a finding: points over time, and the band that is allowed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from grader.checks.finding import Plot
from grader.checks.wording import counted
from grader.report.clean import one_line
from grader.report.histogram import bars
from grader.report.svg import (
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
    ticks,
    unit_of,
)

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
    caption = _caption(plot, points, band, lost)
    return Figure(
        caption,
        _draw(plot, points, band, caption, f"{name}-wide", WIDE),
        _draw(plot, points, band, caption, f"{name}-narrow", NARROW),
    )


def _draw(
    plot: Plot,
    points: Sequence[Point],
    band: Point | None,
    caption: str,
    name: str,
    width: float,
) -> Markup:
    edges = [edge for edge in band or () if abs(edge) < DRAWABLE]
    aside = width * ASIDE if plot.histogram and points else 0.0
    x = Scale(*_span([x for x, _ in points], 0.0), LEFT, width - RIGHT - aside)
    y = Scale(*_span([y for _, y in points] + edges, 0.1), HEIGHT - BOTTOM, TOP)
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
        content += [line(LEFT, y(edge), end, y(edge), "band-edge") for edge in edges]
    for value, text in ticks(y.low, y.high, 4):
        content.append(line(LEFT, y(value), end, y(value), "grid"))
        content.append(label(text, LEFT - 8, y(value) + 4, anchor="end"))
    content.append(line(LEFT, y.begin, end, y.begin, "axis"))
    for value, text in ticks(x.low, x.high, 8 if width > NARROW else 3):
        content.append(line(x(value), y.begin, x(value), y.begin + 5, "axis"))
        content.append(label(text, x(value), y.begin + 18, anchor="middle"))
    content += _series(points, band, x, y)
    if aside:
        content += bars([y for _, y in points], y, x.end + GAP, end)
        content.append(label("how many", end, HEIGHT - 4, anchor="end"))
    return drawing(name, plot.title, caption, (width, HEIGHT), content)


def _series(points: Sequence[Point], band: Point | None, x: Scale, y: Scale) -> list[Markup]:
    shown = _thinned(points, x)
    dense = len(shown) > DOTS
    drawn = []
    placed = [(x(a), y(b)) for a, b in shown]
    if len(shown) > 1:
        drawn.append(curve(placed, "series dense" if dense else "series"))
    within = [_inside(b, band) for _, b in shown]
    inside = [point for point, good in zip(placed, within, strict=True) if good]
    outside = [point for point, good in zip(placed, within, strict=True) if not good]
    if inside and not dense:
        drawn.append(dots(inside, "dots"))
    if outside:
        drawn.append(crosses(_apart(outside), "out"))
    return drawn


def _apart(points: Sequence[Point]) -> list[Point]:
    """Points that are still told apart as crosses; the last of a run always stays."""
    kept: list[Point] = []
    for point in points:
        if len(kept) > 1 and math.dist(kept[-2], point) < APART:
            kept.pop()
        kept.append(point)
    return kept


def _thinned(points: Sequence[Point], x: Scale) -> list[Point]:
    """The lowest and the highest point of every pixel column, where there are too many."""
    if len(points) <= MANY:
        return list(points)
    lowest: dict[int, Point] = {}
    highest: dict[int, Point] = {}
    for point in points:
        column = round(x(point[0]))
        lowest[column] = min(lowest.get(column, point), point, key=lambda item: item[1])
        highest[column] = max(highest.get(column, point), point, key=lambda item: item[1])
    return sorted({*lowest.values(), *highest.values()})


def _span(values: Sequence[float], margin: float) -> tuple[float, float]:
    """Lowest and highest value with a margin, never empty."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    size = max(abs(low), abs(high))
    if high - low > max(1e-9 * size, 1e-12):
        room = (high - low) * margin
    else:
        room = 0.05 * size if size > 1e-9 else 0.5
    return low - room, high + room


def _inside(value: float, band: Point | None) -> bool:
    return band is None or band[0] <= value <= band[1]


def _caption(plot: Plot, points: Sequence[Point], band: Point | None, lost: int) -> str:
    parts = [one_line(plot.title)]
    if not points:
        parts.append("no values")
    elif band:
        outside = sum(not _inside(y, band) for _, y in points)
        parts.append(f"{_allowed(band)}{unit_of(plot.y_label)} (shaded)")
        parts.append(
            f"{outside} of {len(points)} outside (marked ×)"
            if outside
            else f"all {len(points)} inside"
        )
    else:
        parts.append(counted(len(points), "value"))
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
