"""Rows over time, each with a name, a note, bars, ticks and crosses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from grader.report.drawing.axes import Scale
from grader.report.drawing.svg import LETTER, crosses, element, fitted, label

LANE = 36
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
        text = top + index * LANE + 12
        y = text + 6
        track = {"y": y, "height": _TRACK, "rx": 3}
        drawn += [
            label(fitted(lane.name, room - len(lane.note) * LETTER - 12), SIDE, text, "lane"),
            label(lane.note, width - SIDE, text, anchor="end"),
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
    """Pixels of times, each once, so that a flood stays drawable."""
    return sorted({round(pixel * 2) / 2 for pixel in scale.all_clipped(times_s)})
