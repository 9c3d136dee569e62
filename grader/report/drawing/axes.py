"""Scales, ticks, axes and rows over time that the drawings share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from grader.report.drawing.svg import LETTER, NARROW, crosses, element, fitted, label, line
from grader.spec.safe_text import one_line

LEFT, RIGHT = 54, 12
"""Pixels beside a drawing with a vertical axis."""
TIME_AXIS = 40
"""Pixels that the labels of a time axis take below its line."""


@dataclass(frozen=True)
class Scale:
    """A linear map from values, from ``low`` up to ``high``, to pixels."""

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
        """:meth:`clipped` of many values, without a call for each."""
        low, high, begin = self.low, self.high, self.begin
        span, length = high - low, self.end - begin
        inside = [low if value < low else high if value > high else value for value in values]
        return [begin + (value - low) / span * length for value in inside]


def ticks(low: float, high: float, count: int) -> list[tuple[float, str]]:
    """Round values within [low, high], about ``count`` of them, with their labels."""
    rough_step = (high - low) / max(1, count)
    power = 10.0 ** math.floor(math.log10(rough_step))
    # Rounding must not make a step that fits exactly too small.
    step = next(f * power for f in (1, 2, 5, 10) if f * power >= rough_step * 0.999)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    values = [number * step for number in range(first, last + 1)]
    return [(value, _tick_label(value, digits)) for value in values]


def _tick_label(value: float, digits: int) -> str:
    """A value with so many decimals; or as a power of ten where that would be long."""
    if abs(value) >= 1e6 or digits > 4:
        return f"{value:.3g}"
    # Plus zero makes of -0.0 a plain 0.
    return f"{value + 0.0:.{digits}f}"


def value_axis(
    y: Scale, left: float, end: float, marks: Sequence[tuple[float, str]] = ()
) -> list[Markup]:
    """Draw a line from ``left`` to ``end`` for each value, by default for round ones."""
    drawn = []
    for value, text in marks or ticks(y.low, y.high, 4):
        drawn.append(line(left, y(value), end, y(value), "grid"))
        drawn.append(label(text, left - 8, y(value) + 4, anchor="end"))
    return drawn


def time_axis(scale: Scale, y: float, width: float) -> list[Markup]:
    """Draw seconds since launch along a line at ``y``."""
    drawn = [line(scale.begin, y, scale.end, y, "axis")]
    for value, text in ticks(scale.low, scale.high, 10 if width > NARROW else 5):
        x = scale(value)
        anchor = "start" if x < 20 else "end" if x > width - 20 else "middle"
        drawn.append(line(x, y, x, y + 5, "axis"))
        drawn.append(label(text, x, y + 18, anchor=anchor))
    drawn.append(label("time since launch (s)", scale.end, y + 34, anchor="end"))
    return drawn


def unit_of(text: str) -> str:
    """The unit in a label such as ``period (ms)``, with a space before it; nothing without."""
    unit = one_line(text).rpartition("(")[2].rpartition(")")[0]
    return f" {unit}" if unit else ""


LANE = 36
"""Height of a row in pixels."""
SIDE = 6
"""Pixels left free at both sides."""
_TRACK = 12


@dataclass(frozen=True)
class Bar:
    """Something that lasted; times in seconds since launch, ``kind`` as in the style sheet."""

    begin_s: float
    end_s: float
    kind: str = "bar"


@dataclass(frozen=True)
class Lane:
    """A row; all times in seconds since launch."""

    name: str
    note: str
    bars: Sequence[Bar] = ()
    ticks: Sequence[float] = ()
    crosses: Sequence[float] = ()


def draw_lanes(lanes: Sequence[Lane], scale: Scale, top: float, width: float) -> list[Markup]:
    """Draw rows from ``top`` on, each :data:`LANE` pixels high."""
    drawn = []
    room = width - 2 * SIDE
    for index, lane in enumerate(lanes):
        text_y = top + index * LANE + 12
        y = text_y + 6
        track = {"y": y, "height": _TRACK, "rx": 3}
        drawn += [
            label(fitted(lane.name, room - len(lane.note) * LETTER - 12), SIDE, text_y, "lane"),
            label(lane.note, width - SIDE, text_y, anchor="end"),
            element("rect", x=SIDE, width=room, class_="track", **track),
        ]
        for bar in lane.bars:
            begin, end = scale.clipped(bar.begin_s), scale.clipped(bar.end_s)
            length = max(2.0, end - begin)
            drawn.append(element("rect", x=begin, width=length, class_=bar.kind, **track))
        if lane.ticks:
            stroke = f" {y + 1:g}v{_TRACK - 2}"
            path = "".join([f"M{x:g}{stroke}" for x in _columns(scale, lane.ticks)])
            drawn.append(element("path", d=path, class_="tick"))
        if lane.crosses:
            places = [(x, y + _TRACK / 2) for x in _columns(scale, lane.crosses)]
            drawn.append(crosses(places, "out", 4.0))
    return drawn


def _columns(scale: Scale, times_s: Sequence[float]) -> list[float]:
    """Pixels of times, in halves and each once, so that a flood stays drawable."""
    return sorted({round(pixel * 2) / 2 for pixel in scale.all_clipped(times_s)})
