"""Two texts side by side, such as message definitions, with the differences marked."""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import SequenceMatcher

from grader.findings.finding import Comparison
from grader.spec.safe_text import one_line

MOST_LINES = 200
SIGNS = {"same": "", "changed": "≠", "missing": "−", "extra": "+"}
"""Kinds of rows, each with a sign, so that colour is not needed."""
Line = list[tuple[str, bool]]
"""Pieces of a line, each with whether the other side lacks it; none where there is no line."""


@dataclass(frozen=True)
class Row:
    """Two lines beside each other, of one of the kinds in :data:`SIGNS`."""

    kind: str
    expected: Line
    observed: Line


def align(comparison: Comparison) -> list[Row]:
    """Put the lines of a comparison beside each other, those first that belong together."""
    left = [one_line(text) for text in comparison.expected[:MOST_LINES]]
    right = [one_line(text) for text in comparison.observed[:MOST_LINES]]
    rows: list[Row] = []
    for what, a1, a2, b1, b2 in SequenceMatcher(None, left, right, autojunk=False).get_opcodes():
        both = min(a2 - a1, b2 - b1)
        for one, other in zip(left[a1 : a1 + both], right[b1 : b1 + both], strict=True):
            rows.append(Row("same" if what == "equal" else "changed", *_marked(one, other)))
        rows += [Row("missing", [(text, False)], []) for text in left[a1 + both : a2]]
        rows += [Row("extra", [], [(text, False)]) for text in right[b1 + both : b2]]
    return rows


def _marked(left: str, right: str) -> tuple[Line, Line]:
    """Mark the words that differ."""
    a, b = re.findall(r"\s+|\w+|[^\w\s]", left), re.findall(r"\s+|\w+|[^\w\s]", right)
    codes = SequenceMatcher(None, a, b, autojunk=False).get_opcodes()
    return (
        [("".join(a[a1:a2]), what != "equal") for what, a1, a2, _, _ in codes if a1 < a2],
        [("".join(b[b1:b2]), what != "equal") for what, _, _, b1, b2 in codes if b1 < b2],
    )
