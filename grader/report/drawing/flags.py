"""Labels above a time line, each with a leader down to its time; no two texts collide."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
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
        left: Whether its text lies left of the leader, because it would not fit on the right.
    """

    flag: Flag
    x: float
    row: int
    left: bool

    @property
    def extent(self) -> tuple[float, float]:
        """First and last pixel of its text."""
        begin = self.x - self.flag.length if self.left else self.x
        return begin, begin + self.flag.length


def place(flags: Sequence[Flag], scale: Scale) -> list[PlacedFlag]:
    """Give every flag a row, so that no text meets another.

    Texts to the right of their leaders go down from row to row as long as they would meet an
    earlier one: a later leader then begins below the earlier text. Texts to the left mirror
    this: the latest is on top. Where both kinds meet, all of the second lie above the first,
    and only there a leader passes behind a text.

    Args:
        flags: By time.
        scale: Seconds to pixels.
    """
    at = [(scale.clipped(flag.time_s), flag) for flag in flags]
    fit = [(x, flag) for x, flag in at if x + flag.length <= scale.end]
    others = [(x, flag) for x, flag in reversed(at) if x + flag.length > scale.end]
    rights = _rows((x, flag.length) for x, flag in fit)
    lefts = _rows((-x, flag.length) for x, flag in others)
    reach = max((x + flag.length for x, flag in fit), default=float("-inf"))
    begin = min((x - flag.length for x, flag in others), default=float("inf"))
    offset = 1 + max(lefts) if lefts and begin < reach + GAP else 0
    placed = [
        PlacedFlag(flag, x, row + offset, False) for (x, flag), row in zip(fit, rights, strict=True)
    ]
    placed += [PlacedFlag(flag, x, row, True) for (x, flag), row in zip(others, lefts, strict=True)]
    return sorted(placed, key=lambda item: (item.flag.time_s, item.x))


def _rows(texts: Iterable[tuple[float, float]]) -> list[int]:
    """A row for each text, given by begin and length: below all earlier ones that reach it."""
    rows: list[int] = []
    ends: list[float] = []
    for begin, length in texts:
        met = [row for row, end in zip(rows, ends, strict=True) if end > begin - 1]
        rows.append(1 + max(met, default=-1))
        ends.append(begin + length)
    return rows


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
