"""Labels above a time line, each with a leader down to its time; no two texts collide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from grader.report.drawing.axes import Scale
from grader.report.drawing.svg import LETTER, label, line

ROW = 17
GAP = 6


@dataclass(frozen=True)
class Flag:
    """A labelled time, in seconds since launch."""

    time_s: float
    text: str

    @property
    def length(self) -> float:
        """Pixels that its text takes."""
        return len(self.text) * LETTER + GAP


@dataclass(frozen=True)
class PlacedFlag:
    """A flag with its place.

    Attributes:
        x: Pixel of its leader.
        extent: First and last pixel of its text.
        left: Whether its text lies left of the leader, because it would not fit on the right.
    """

    flag: Flag
    x: float
    extent: tuple[float, float]
    left: bool
    row: int


def place(flags: Sequence[Flag], scale: Scale) -> list[PlacedFlag]:
    """Give every flag a row, so that no text meets another.

    Each goes below all texts before it that it would meet: so the leader of a later one begins
    below an earlier text. Texts to the left mirror this, the latest is on top, and they come
    first: only there a leader passes behind a text.

    Args:
        flags: By time.
        scale: Seconds to pixels.
    """
    placed: list[PlacedFlag] = []
    at = [(scale.clipped(flag.time_s), flag) for flag in flags]
    lefts = [(x, flag) for x, flag in reversed(at) if x + flag.length > scale.end]
    rights = [(x, flag) for x, flag in at if x + flag.length <= scale.end]
    for index, (x, flag) in enumerate(lefts + rights):
        left = index < len(lefts)
        begin, end = extent = (x - flag.length, x) if left else (x, x + flag.length)
        met = [one.row for one in placed if one.extent[0] < end + 1 and begin - 1 < one.extent[1]]
        placed.append(PlacedFlag(flag, x, extent, left, 1 + max(met, default=-1)))
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
