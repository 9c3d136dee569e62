"""Words that every format uses: of a status, of points, of advice."""

from __future__ import annotations

from typing import NamedTuple

from grader.findings.finding import Status


class StatusWords(NamedTuple):
    """A status for people; the symbol tells it without colour, and in ASCII too."""

    word: str
    symbol: str
    ascii: str


STATUS = {
    Status.PASSED: StatusWords("passed", "✓", "+"),
    Status.FAILED: StatusWords("failed", "✗", "x"),
    Status.SKIPPED: StatusWords("skipped", "–", "-"),
    Status.ERROR: StatusWords("error", "!", "!"),
}
NO_POINTS = StatusWords("no points", "○", "o")
"""Of a check that failed and gives no points: nothing is lost, so it is not red."""
NOT_SO = {Status.FAILED: "Not yet: ", Status.ERROR: "Not judged: "}
"""What stands before the title of a check, which says what is so once it passes."""
ADVICE = ("try next", "also")
"""What stands before the first piece of advice, and before every other."""


def number(value: float) -> str:
    """Points without needless digits: ``3``, ``2.5``."""
    return f"{value:.10g}"


def counted_points(points: float) -> str:
    """``1 point``, ``2.5 points``."""
    return f"{number(points)} point{'' if points == 1 else 's'}"


def cut(text: str, most: int) -> str:
    """The beginning of a text that is too long."""
    return text if len(text) <= most else f"{text[: most - 1]}…"
