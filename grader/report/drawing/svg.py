"""Building blocks of the drawings in a report: elements, lines, labels.

Drawings carry no colour of their own: the style sheet gives it by class, light and dark. Each
is made twice, wide and narrow, because text that is scaled down to a phone cannot be read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from grader.spec.safe_text import one_line

WIDE, NARROW = 760, 330
LETTER = 6.3
"""Mean width of a character of the labels, in pixels; generous, so that nothing collides."""
Point = tuple[float, float]


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


def figure(
    name: str,
    title: str,
    caption: str,
    draw: Callable[[float], tuple[float, Iterable[str]]],
    description: str = "",
) -> Figure:
    """Draw a figure for both widths, with the title and description that a screen reader says.

    Args:
        name: Unique in the document; letters, digits and hyphens.
        draw: Takes the width and gives the height, both in pixels, and the content.
        description: By default the caption.
    """
    drawings = []
    for kind, width in (("wide", WIDE), ("narrow", NARROW)):
        height, content = draw(width)
        own = f"{name}-{kind}"
        drawings.append(
            element(
                "svg",
                element("title", one_line(title), id=f"{own}-title"),
                element("desc", one_line(description or caption), id=f"{own}-desc"),
                *content,
                viewBox=f"0 0 {width:g} {height:g}",
                width=width,
                height=height,
                role="img",
                aria_labelledby=f"{own}-title {own}-desc",
            )
        )
    return Figure(caption, *drawings)


def element(tag: str, *content: str, **attributes: str | float) -> Markup:
    """An element; text and attributes are escaped, nested elements are not again.

    Args:
        attributes: By name; ``class_`` gives ``class``, ``stroke_width`` ``stroke-width``.
    """
    # Plain strings, each escaped here: Markup.format takes ten times as long.
    written = "".join(
        [
            f" {name.rstrip('_').replace('_', '-')}="
            f'"{escape(value) if isinstance(value, str) else _pixel(value)}"'
            for name, value in attributes.items()
        ]
    )
    return Markup(f"<{tag}{written}>{''.join(map(escape, content))}</{tag}>")


def line(x1: float, y1: float, x2: float, y2: float, class_: str) -> Markup:
    """A straight line."""
    return element("line", x1=x1, y1=y1, x2=x2, y2=y2, class_=class_)


def label(text: str, x: float, y: float, class_: str = "label", anchor: str = "start") -> Markup:
    """A line of text; ``anchor`` is ``start``, ``middle`` or ``end``."""
    return element("text", one_line(text), x=x, y=y, class_=class_, text_anchor=anchor)


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
    """Leave out what lies on the line between its neighbours.

    The algorithm of Douglas and Peucker (1973, doi:10.3138/FM57-6770-U75U-7727), without
    recursion.

    Args:
        points: At least one.
        tolerance: Greatest distance from the line, in the unit of the points.
    """
    kept = {0, len(points) - 1}
    parts = [(0, len(points) - 1)]
    while parts:
        first, last = parts.pop()
        if last - first < 2:
            continue
        (x1, y1), (x2, y2) = points[first], points[last]
        dx, dy = x2 - x1, y2 - y1
        length = math.hypot(dx, dy)
        between = points[first + 1 : last]
        if length > tolerance:
            # The distance from the line times its length: one division less for each point.
            offs = [abs(dx * (y - y1) - dy * (x - x1)) for x, y in between]
        else:
            offs, length = [math.hypot(x - x1, y - y1) for x, y in between], 1.0
        worst = max(offs)
        if worst > tolerance * length:
            index = first + 1 + offs.index(worst)
            kept.add(index)
            parts += [(first, index), (index, last)]
    return [points[index] for index in sorted(kept)]


def fitted(text: str, width: float) -> str:
    """Shorten text in its middle so that it fits into a width in pixels."""
    text = one_line(text)
    room = max(5, int(width / LETTER))
    if len(text) <= room:
        return text
    head = (room - 1) // 2
    return f"{text[:head]}…{text[len(text) - (room - 1 - head) :]}"


def _pixel(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


def _pair(point: Point) -> str:
    return f"{_pixel(point[0])} {_pixel(point[1])}"
