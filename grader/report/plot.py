"""The plot of a finding: points over time, and the band that is allowed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from grader.checks.finding import Plot
from grader.checks.wording import counted
from grader.report.clean import one_line
from grader.report.svg import (
    NARROW,
    WIDE,
    Figure,
    Scale,
    cross,
    drawing,
    element,
    label,
    line,
    ticks,
)

HEIGHT = 232
LEFT, RIGHT, TOP, BOTTOM = 54, 12, 26, 42
DRAWABLE = 1e15
"""Beyond this a double cannot tell neighbouring pixels apart."""
MANY = 600
"""Points that are still drawn one by one."""

Point = tuple[float, float]


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
    x = Scale(*_span([x for x, _ in points], 0.0), LEFT, width - RIGHT)
    y = Scale(*_span([y for _, y in points] + edges, 0.1), HEIGHT - BOTTOM, TOP)
    content = [
        label(plot.y_label, 0, 12),
        label(plot.x_label, width - RIGHT, HEIGHT - 4, anchor="end"),
    ]
    if band:
        top, bottom = y.clipped(band[1]), y.clipped(band[0])
        content.append(
            element(
                "rect",
                x=LEFT,
                y=top,
                width=x.end - LEFT,
                height=max(1.0, bottom - top),
                class_="band",
            )
        )
        content += [line(LEFT, y(edge), x.end, y(edge), "band-edge") for edge in edges]
    for value, text in ticks(y.low, y.high, 4):
        content.append(line(LEFT, y(value), x.end, y(value), "grid"))
        content.append(label(text, LEFT - 8, y(value) + 4, anchor="end"))
    content.append(line(LEFT, y.begin, x.end, y.begin, "axis"))
    for value, text in ticks(x.low, x.high, 8 if width > NARROW else 4):
        content.append(line(x(value), y.begin, x(value), y.begin + 5, "axis"))
        content.append(label(text, x(value), y.begin + 18, anchor="middle"))
    content += _series(points, band, x, y)
    return drawing(name, plot.title, caption, (width, HEIGHT), content)


def _series(points: Sequence[Point], band: Point | None, x: Scale, y: Scale) -> list[Markup]:
    shown = _thinned(points, x)
    path = "M" + "L".join(f"{x(a):.1f} {y(b):.1f}" for a, b in shown)
    drawn = [element("path", d=path, class_="series")] if len(shown) > 1 else []
    for a, b in shown:
        if _inside(b, band):
            drawn.append(element("circle", cx=x(a), cy=y(b), r=2.5, class_="dot"))
        else:
            drawn.append(cross(x(a), y(b), "out"))
    return drawn


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
        parts.append(f"{_allowed(band)} (shaded)")
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
