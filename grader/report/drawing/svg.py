"""Building blocks of the drawings in a report: elements, scales, ticks.

Drawings carry no colour of their own: the style sheet gives it by class, light and dark. Each
is made twice, wide and narrow, because text that is scaled down to a phone cannot be read.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

from markupsafe import Markup, escape

from grader.safe_text import one_line

WIDE, NARROW = 760, 330
Point = tuple[float, float]
_PLAIN = frozenset("&<>\"'")
"""Characters that are escaped; where none is, nothing is to be done."""
LETTER = 6.3
"""Mean width of a character of the labels, in pixels; generous, so that nothing collides."""


@dataclass(frozen=True)
class Figure:
    """A drawing.

    Attributes:
        wide: SVG for :data:`WIDE` pixels.
        narrow: The same for :data:`NARROW` pixels.
    """

    caption: str
    wide: Markup
    narrow: Markup


@dataclass(frozen=True)
class Scale:
    """A linear map from values to pixels.

    Attributes:
        low: Value at ``begin``.
        high: Value at ``end``, more than ``low``.
        begin: Pixel.
        end: Pixel.
    """

    low: float
    high: float
    begin: float
    end: float

    def __call__(self, value: float) -> float:
        """The pixel of a value, which may lie outside."""
        share = (value - self.low) / (self.high - self.low)
        return self.begin + share * (self.end - self.begin)

    def clipped(self, value: float) -> float:
        """The pixel of a value, moved to the nearest end if it lies outside."""
        return self(min(max(value, self.low), self.high))

    def all_clipped(self, values: Iterable[float]) -> list[float]:
        """:meth:`clipped` of many values, in a fraction of the time."""
        low, high, begin = self.low, self.high, self.begin
        span, width = high - low, self.end - begin
        return [
            begin + ((low if value < low else high if value > high else value) - low) / span * width
            for value in values
        ]


def element(tag: str, *content: str, **attributes: str | float) -> Markup:
    """An element; text and attributes are escaped, nested elements are not again.

    Args:
        attributes: By name; ``class_`` gives ``class``, ``stroke_width`` ``stroke-width``.
    """
    # Plain strings, each escaped here: Markup.format takes ten times as long.
    written = "".join(
        [f' {_name(name)}="{_attribute(value)}"' for name, value in attributes.items()]
    )
    inner = "".join([item if isinstance(item, Markup) else _escaped(item) for item in content])
    return Markup(f"<{tag}{written}>{inner}</{tag}>")


def drawing(
    name: str, title: str, description: str, size: tuple[float, float], content: Iterable[str]
) -> Markup:
    """A whole SVG, with the title and description that a screen reader says.

    Args:
        name: Unique in the document; letters, digits and hyphens.
        size: Width and height in pixels.
    """
    width, height = size
    return element(
        "svg",
        element("title", one_line(title), id=f"{name}-title"),
        element("desc", one_line(description), id=f"{name}-desc"),
        *content,
        viewBox=f"0 0 {width:g} {height:g}",
        width=width,
        height=height,
        role="img",
        aria_labelledby=f"{name}-title {name}-desc",
    )


def line(x1: float, y1: float, x2: float, y2: float, class_: str) -> Markup:
    """A straight line."""
    # Most elements are lines and labels: these two are written as they are.
    return Markup(
        f'<line x1="{_pixel(x1)}" y1="{_pixel(y1)}" x2="{_pixel(x2)}" y2="{_pixel(y2)}" '
        f'class="{_escaped(class_)}"></line>'
    )


def label(text: str, x: float, y: float, class_: str = "label", anchor: str = "start") -> Markup:
    """A line of text; ``anchor`` is ``start``, ``middle`` or ``end``."""
    return Markup(
        f'<text x="{_pixel(x)}" y="{_pixel(y)}" class="{_escaped(class_)}" '
        f'text-anchor="{_escaped(anchor)}">{_escaped(one_line(text))}</text>'
    )


def curve(points: Sequence[Point], class_: str) -> Markup:
    """A line through points, as smooth as a screen can show and no finer."""
    return element("path", d="M" + "L".join(map(_pair, simplified(points))), class_=class_)


def dots(points: Iterable[Point], class_: str) -> Markup:
    """A round dot on each point; the style sheet gives its size as the width of a stroke."""
    return element("path", d="".join(f"M{_pair(point)}h0" for point in points), class_=class_)


def crosses(points: Iterable[Point], class_: str, size: float = 3.5) -> Markup:
    """A diagonal cross around each point, all in one element."""
    there, back = f"l{2 * size:g} {2 * size:g}", f"m{-2 * size:g} 0l{2 * size:g} {-2 * size:g}"
    path = "".join(f"M{_pair((x - size, y - size))}{there}{back}" for x, y in points)
    return element("path", d=path, class_=class_)


def simplified(points: Sequence[Point], tolerance: float = 0.3) -> list[Point]:
    """Leave out what lies on the line between its neighbours; see :func:`outline`."""
    return [points[index] for index in outline(points, tolerance)]


def outline(points: Sequence[Point], tolerance: float = 0.3) -> list[int]:
    """Find the points that a line cannot do without.

    The algorithm of Douglas and Peucker (1973, doi:10.3138/FM57-6770-U75U-7727), without
    recursion.

    Args:
        points: At least one.

    Returns:
        Their indices, in order.
    """
    kept = {0, len(points) - 1}
    parts = [(0, len(points) - 1)] if len(points) > 2 else []
    while parts:
        first, last = parts.pop()
        (x1, y1), (x2, y2) = points[first], points[last]
        dx, dy = x2 - x1, y2 - y1
        length = math.hypot(dx, dy)
        between = points[first + 1 : last]
        if length > tolerance:
            # The distance from the line times its length: one division less for each point.
            offs = [abs(dx * (y - y1) - dy * (x - x1)) for x, y in between]
            limit = tolerance * length
        else:
            offs = [math.hypot(x - x1, y - y1) for x, y in between]
            limit = tolerance
        worst = max(offs)
        if worst > limit:
            index = first + 1 + offs.index(worst)
            kept.add(index)
            # Half of all parts have no point in between.
            if index - first > 1:
                parts.append((first, index))
            if last - index > 1:
                parts.append((index, last))
    return sorted(kept)


def fitted(text: str, width: float) -> str:
    """Shorten text in its middle so that it fits into a width in pixels."""
    text = one_line(text)
    room = max(5, int(width / LETTER))
    if len(text) <= room:
        return text
    head = (room - 1) // 2
    return f"{text[:head]}…{text[len(text) - (room - 1 - head) :]}"


def unit_of(text: str) -> str:
    """The unit in a label such as ``period (ms)``, with a space before it; nothing without."""
    unit = one_line(text).rpartition("(")[2].rpartition(")")[0]
    return f" {unit}" if unit else ""


def ticks(low: float, high: float, count: int) -> tuple[tuple[float, str], ...]:
    """Round values within [low, high], about ``count`` of them, with their labels."""
    rough = (high - low) / max(1, count)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough * 0.999)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    values = [number * step for number in range(first, last + 1)]
    return tuple((value, _number(value, digits)) for value in values)


def columns(pixels: Sequence[float]) -> list[float]:
    """One of all pixels that fall into the same column, so that a flood stays drawable."""
    return sorted({round(pixel * 2) / 2 for pixel in pixels})


def _number(value: float, digits: int) -> str:
    if abs(value) >= 1e6 or digits > 4:
        return f"{value:.3g}"
    return f"{value + 0.0:.{digits}f}"


@cache
def _name(name: str) -> str:
    return name.rstrip("_").replace("_", "-")


def _attribute(value: str | float) -> str:
    return _escaped(value) if isinstance(value, str) else _pixel(value)


def _pixel(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


def _escaped(text: str) -> str:
    return text if _PLAIN.isdisjoint(text) else escape(text)


def _pair(point: Point) -> str:
    return f"{point[0]:.1f} {point[1]:.1f}".replace(".0 ", " ").removesuffix(".0")
