"""Two texts side by side, such as message definitions, with the differences marked."""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import SequenceMatcher

from grader.checks.finding import Comparison
from grader.safe_text import one_line

MOST_LINES = 200
SIGNS = {"same": "", "changed": "≠", "missing": "−", "extra": "+"}


@dataclass(frozen=True)
class Piece:
    """Part of a line; ``differs`` marks what the other side does not have."""

    text: str
    differs: bool


@dataclass(frozen=True)
class Row:
    """Two lines beside each other.

    Attributes:
        kind: ``same``, ``changed``, ``missing`` (only expected) or ``extra`` (only observed).
        expected: Pieces of the line, none where there is no line.
        observed: Pieces of the line, none where there is no line.
    """

    kind: str
    expected: tuple[Piece, ...]
    observed: tuple[Piece, ...]

    @property
    def sign(self) -> str:
        """The kind as a sign, so that colour is not needed."""
        return SIGNS[self.kind]


def align(comparison: Comparison) -> tuple[Row, ...]:
    """Put the lines of a comparison beside each other, those first that belong together."""
    left = [one_line(text) for text in comparison.expected[:MOST_LINES]]
    right = [one_line(text) for text in comparison.observed[:MOST_LINES]]
    rows: list[Row] = []
    for what, a1, a2, b1, b2 in SequenceMatcher(None, left, right, autojunk=False).get_opcodes():
        if what == "equal":
            rows += [Row("same", _plain(text), _plain(text)) for text in left[a1:a2]]
            continue
        both = min(a2 - a1, b2 - b1)
        rows += [_changed(left[a1 + i], right[b1 + i]) for i in range(both)]
        rows += [Row("missing", _plain(text), ()) for text in left[a1 + both : a2]]
        rows += [Row("extra", (), _plain(text)) for text in right[b1 + both : b2]]
    return tuple(rows)


def _plain(text: str) -> tuple[Piece, ...]:
    return (Piece(text, False),)


def _changed(left: str, right: str) -> Row:
    """Mark the words that differ."""
    a, b = re.findall(r"\s+|\w+|[^\w\s]", left), re.findall(r"\s+|\w+|[^\w\s]", right)
    expected: list[Piece] = []
    observed: list[Piece] = []
    for what, a1, a2, b1, b2 in SequenceMatcher(None, a, b, autojunk=False).get_opcodes():
        if a1 < a2:
            expected.append(Piece("".join(a[a1:a2]), what != "equal"))
        if b1 < b2:
            observed.append(Piece("".join(b[b1:b2]), what != "equal"))
    return Row("changed", tuple(expected), tuple(observed))
