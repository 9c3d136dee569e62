"""The plot of a finding: points over time, and the band that is allowed."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from itertools import compress
from operator import itemgetter

from markupsafe import Markup

from grader.findings.finding import Plot
from grader.findings.words import counted
from grader.report.drawing import svg
from grader.report.drawing.axes import LEFT, RIGHT, Scale, ticks, unit_of, value_axis
from grader.spec.safe_text import one_line

HEIGHT, TOP, BOTTOM = 232, 26, 42
DRAWABLE = 1e15
"""Beyond this a double cannot tell neighbouring pixels apart."""
MANY = 600
"""Points that are still all looked at."""
ASIDE, GAP = 0.2, 14
"""Share of the width that a histogram takes, and the pixels before it."""
BIN = 8
"""Height of a bar of a histogram, in pixels."""
APART = 5.0
"""Least distance of two crosses in pixels."""
DOTS = 120
"""Most points that are drawn one by one; more are a line."""


def draw_plot(plot: Plot, name: str) -> svg.Figure:
    """Draw a plot.

    Args:
        plot: Its values; those that are not finite are left out, and the caption says so.
    """
    points = [
        (x, y)
        for x, y in zip(plot.x, plot.y, strict=False)
        if abs(x) < DRAWABLE and abs(y) < DRAWABLE
    ]
    band = plot.band if plot.band and not any(math.isnan(edge) for edge in plot.band) else None
    low, high = band or (-math.inf, math.inf)
    edges = [edge for edge in band or () if abs(edge) < DRAWABLE]
    ordinates = [y for _, y in points]
    y = Scale(*_span(ordinates + edges, 0.1), HEIGHT - BOTTOM, TOP)
    first, last = plot.judged or (-math.inf, math.inf)

    def is_wrong(point: svg.Point) -> bool:
        return first <= point[0] <= last and not low <= point[1] <= high

    def draw(width: float) -> tuple[float, list[Markup]]:
        end = width - RIGHT
        aside = width * ASIDE if plot.histogram and points else 0.0
        x = Scale(*_span([x for x, _ in points], 0.0), LEFT, end - aside)
        content = [
            svg.label(plot.y_label, 0, 12),
            svg.label(plot.x_label, x.end, HEIGHT - 4, anchor="end"),
        ]
        if band:
            top, bottom = y.clipped(high), y.clipped(low)
            height = max(1.0, bottom - top)
            begin, until = (LEFT, end) if plot.judged is None else x.all_clipped(plot.judged)
            width = max(2.0, until - begin)
            content.append(
                svg.element("rect", x=begin, y=top, width=width, height=height, class_="band")
            )
            content += [svg.line(begin, y(edge), until, y(edge), "band-edge") for edge in edges]
        content += value_axis(y, LEFT, end)
        content.append(svg.line(LEFT, y.begin, end, y.begin, "axis"))
        for value, text in ticks(x.low, x.high, 8 if width > svg.NARROW else 3):
            content.append(svg.line(x(value), y.begin, x(value), y.begin + 5, "axis"))
            content.append(svg.label(text, x(value), y.begin + 18, anchor="middle"))
        content += _series(points, is_wrong, x, y)
        if aside:
            content += _bars(ordinates, y, x.end + GAP, end)
            content.append(svg.label("how many", end, HEIGHT - 4, anchor="end"))
        return HEIGHT, content

    lost = max(len(plot.x), len(plot.y)) - len(points)
    judged = [point for point in points if first <= point[0] <= last]
    wrong = sum(map(is_wrong, judged))
    caption = _caption(plot, (len(points), len(judged), wrong), band, lost)
    return svg.figure(name, plot.title, caption, draw)


def _series(
    points: Sequence[svg.Point], is_wrong: Callable[[svg.Point], bool], x: Scale, y: Scale
) -> list[Markup]:
    shown = _thinned(points, x) if len(points) > MANY else points
    across, down = x.all_clipped([a for a, _ in shown]), y.all_clipped([b for _, b in shown])
    placed = list(zip(across, down, strict=True))
    wrong = list(map(is_wrong, shown))
    bad = list(compress(placed, wrong))
    dense = len(placed) > DOTS
    drawn = []
    if len(placed) > 1:
        drawn.append(svg.curve(placed, "series dense" if dense else "series"))
    if not dense and not all(wrong):
        good = [pixel for pixel, is_bad in zip(placed, wrong, strict=True) if not is_bad]
        drawn.append(svg.dots(good, "dots"))
    if bad:
        drawn.append(svg.crosses(_apart(bad), "out"))
    return drawn


def _apart(points: Sequence[svg.Point]) -> list[svg.Point]:
    """Points far enough apart for crosses; the last of a run always stays."""
    kept: list[svg.Point] = []
    for point in points:
        if len(kept) > 1 and math.dist(kept[-2], point) < APART:
            kept.pop()
        kept.append(point)
    return kept


def _thinned(points: Sequence[svg.Point], x: Scale) -> list[svg.Point]:
    """The lowest and the highest point of every pixel column, by abscissa."""
    columns: defaultdict[int, list[svg.Point]] = defaultdict(list)
    for pixel, point in zip(x.all_clipped([a for a, _ in points]), points, strict=True):
        columns[round(pixel)].append(point)
    extremes = (
        extreme(found, key=itemgetter(1)) for found in columns.values() for extreme in (min, max)
    )
    return sorted(set(extremes))


def _bars(values: Sequence[float], y: Scale, left: float, right: float) -> list[Markup]:
    """How often each value occurs, as bars beside the plot, with the counts to the right."""
    counts = Counter(int((y.begin - pixel) // BIN) for pixel in y.all_clipped(values))
    most = max(counts.values())
    drawn = [svg.line(left, y.begin, left, y.end, "axis")]
    for row, count in sorted(counts.items()):
        top = max(y.end, y.begin - (row + 1) * BIN)
        width = max(1.5, (right - left) * count / most)
        drawn.append(
            svg.element("rect", x=left, y=top + 1, width=width, height=BIN - 2, class_="count")
        )
    drawn.append(svg.label("0", left, y.begin + 18, anchor="middle"))
    drawn.append(svg.label(str(most), right, y.begin + 18, anchor="end"))
    return drawn


def _span(values: Sequence[float], margin: float) -> tuple[float, float]:
    """Lowest and highest value with a margin, never empty."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    size = max(abs(low), abs(high))
    if high - low > max(1e-9 * size, 1e-12):
        room = (high - low) * margin
    else:
        room = 0.05 * size if size > 1e-9 else 0.5
    return low - room, high + room


def _caption(plot: Plot, numbers: tuple[int, int, int], band: svg.Point | None, lost: int) -> str:
    """Say what is allowed; the numbers are of all points, of the judged, and of the wrong ones."""
    shown, count, outside = numbers
    parts = [counted(shown, "value") if shown else "no values"]
    if count and band:
        low, high = band
        allowed = f"{low:.6g} to {high:.6g}"
        if math.isinf(low) or math.isinf(high):
            allowed = f"up to {high:.6g}" if math.isinf(low) else f"from {low:.6g}"
        inside = f"{outside} of {count} outside (marked ×)" if outside else f"all {count} inside"
        where = "shaded, where it is judged" if count < shown else "shaded"
        parts = [f"allowed {allowed}{unit_of(plot.y_label)} ({where})", inside]
    if lost:
        parts.append(f"{lost} not finite and not drawn")
    return f"{one_line(plot.title)}: {', '.join(parts)}."
