"""Labels above a time line, each with a leader down to its time; no two texts collide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from grader.report.drawing.svg import LETTER, Scale, label, line

ROW = 17
GAP = 6


@dataclass(frozen=True)
class Flag:
    """A labelled time.

    Attributes:
        time_s: Seconds since launch.
    """

    time_s: float
    text: str


@dataclass(frozen=True)
class PlacedFlag:
    """A flag with its place.

    Attributes:
        x: Pixel of its leader.
        left: Whether its text lies left of the leader, because it would not fit on the right.
    """

    flag: Flag
    x: float
    row: int
    left: bool

    @property
    def extent(self) -> tuple[float, float]:
        """First and last pixel of its text."""
        length = len(self.flag.text) * LETTER + GAP
        return (self.x - length, self.x) if self.left else (self.x, self.x + length)


def place(flags: Sequence[Flag], scale: Scale) -> tuple[PlacedFlag, ...]:
    """Give every flag a row, so that no text meets another.

    Texts to the right of their leaders go down from row to row as long as they would meet an
    earlier one: a later leader then begins below the earlier text. Texts to the left mirror
    this: the latest is on top. Where both kinds meet, all of the second lie above the first,
    and only there a leader passes behind a text.

    Args:
        scale: Seconds to pixels.
    """
    rights: list[PlacedFlag] = []
    lefts: list[PlacedFlag] = []
    for flag in flags:
        x = scale.clipped(flag.time_s)
        if x + len(flag.text) * LETTER + GAP <= scale.end:
            rights.append(PlacedFlag(flag, x, _free_row(rights, x), left=False))
    for flag in reversed(flags):
        x = scale.clipped(flag.time_s)
        if x + len(flag.text) * LETTER + GAP > scale.end:
            mirrored = [PlacedFlag(item.flag, -item.x, item.row, left=False) for item in lefts]
            lefts.append(PlacedFlag(flag, x, _free_row(mirrored, -x), left=True))
    reach = max((item.extent[1] for item in rights), default=float("-inf"))
    begin = min((item.extent[0] for item in lefts), default=float("inf"))
    offset = 1 + max(item.row for item in lefts) if lefts and begin < reach + GAP else 0
    moved = [PlacedFlag(item.flag, item.x, item.row + offset, item.left) for item in rights]
    return tuple(sorted(moved + lefts, key=lambda item: (item.flag.time_s, item.x)))


def _free_row(placed: Sequence[PlacedFlag], x: float) -> int:
    """The first row from which on nothing reaches a leader at ``x``."""
    return 1 + max((item.row for item in placed if item.extent[1] > x - 1), default=-1)


def draw_flags(flags: Sequence[Flag], scale: Scale, below: float) -> tuple[list[Markup], float]:
    """Draw flags with leaders that go on through what is drawn below.

    Args:
        scale: Seconds to pixels.
        below: Height of what is drawn below, in pixels.

    Returns:
        The elements, and the pixel at which to draw what is below.
    """
    placed = place(flags, scale)
    top = ROW * (1 + max((item.row for item in placed), default=0)) + 6
    leaders, labels = [], []
    for item in placed:
        y = ROW * item.row
        leaders.append(line(item.x, y + 4, item.x, top + below, "leader"))
        anchor, shift = ("end", -4) if item.left else ("start", 4)
        labels.append(label(item.flag.text, item.x + shift, y + 13, "flag", anchor))
    return leaders + labels, top
