"""Labels above a time line, each with a leader down to its time; no two texts collide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from markupsafe import Markup

from grader.report.drawing.axes import Scale
from grader.report.drawing.svg import LETTER, label, line

ROW = 17
GAP = 6


class Flag(NamedTuple):
    """A labelled time, in seconds since launch."""

    time_s: float
    text: str


class PlacedFlag(NamedTuple):
    """A flag with the pixel of its leader, and the first and the last one of its text."""

    flag: Flag
    x: float
    extent: tuple[float, float]
    row: int

    @property
    def left(self) -> bool:
        """Whether its text lies left of the leader, because it would not fit on the right."""
        return self.extent[0] < self.x


def place(flags: Sequence[Flag], scale: Scale) -> list[PlacedFlag]:
    """Give every flag, by time, a row, so that no text meets another.

    Each goes below all texts before it that it would meet: so the leader of a later one begins
    below an earlier text. Texts to the left mirror this, the latest is on top, and they come
    first: only there a leader passes behind a text.
    """
    placed: list[PlacedFlag] = []
    lefts: list[tuple[Flag, float, tuple[float, float]]] = []
    rights: list[tuple[Flag, float, tuple[float, float]]] = []
    for flag in flags:
        x, length = scale.clipped(flag.time_s), len(flag.text) * LETTER + GAP
        if x + length > scale.end:
            lefts.insert(0, (flag, x, (x - length, x)))
        else:
            rights.append((flag, x, (x, x + length)))
    for flag, x, (begin, end) in lefts + rights:
        met = [one.row for one in placed if one.extent[0] < end + 1 and begin - 1 < one.extent[1]]
        placed.append(PlacedFlag(flag, x, (begin, end), 1 + max(met, default=-1)))
    return sorted(placed, key=lambda one: (one.flag.time_s, one.x))


def draw_flags(flags: Sequence[Flag], scale: Scale, below: float) -> tuple[list[Markup], float]:
    """Draw flags with leaders that go on through what is drawn below.

    Args:
        below: Height of what is drawn below, in pixels.

    Returns:
        The elements, and the pixel at which to draw what is below.
    """
    placed = place(flags, scale)
    top = ROW * (1 + max((one.row for one in placed), default=0)) + 6
    leaders, labels = [], []
    for one in placed:
        y = ROW * one.row
        leaders.append(line(one.x, y + 4, one.x, top + below, "leader"))
        anchor, shift = ("end", -4) if one.left else ("start", 4)
        labels.append(label(one.flag.text, one.x + shift, y + 13, "flag", anchor))
    return leaders + labels, top
