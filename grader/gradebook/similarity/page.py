"""The page of the submissions that are alike, side by side; for the instructor only."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import groupby

from grader.gradebook.similarity.fingerprints import fingerprints
from grader.gradebook.similarity.pairs import Pair, shared_passages
from grader.report.html.page import render_page

MOST_PAIRS = 100
"""Pairs that the page shows side by side; more are only counted."""
_Chunk = tuple[int | None, list[tuple[int, str]]]
"""The number of a shared passage, or None, and lines with their numbers."""


def render_similarity(
    title: str,
    pairs: Sequence[Pair],
    sources: Mapping[str, Mapping[str, str]],
    names: Mapping[str, str],
    left_out: Collection[str],
) -> str:
    """Render the page, which has no script.

    Args:
        sources: Files by key.
        names: Of all that were compared, by key.
        left_out: Names of those whose source could not be compared.
    """
    return render_page(
        "similarity.html.j2",
        ("report.css", "instructor.css"),
        title=title,
        pairs=[(pair, list(_sides(pair, sources))) for pair in pairs[:MOST_PAIRS]],
        more=len(pairs[MOST_PAIRS:]),
        names=names,
        left_out=sorted(left_out),
    )


def _sides(
    pair: Pair, sources: Mapping[str, Mapping[str, str]]
) -> Iterator[tuple[str, dict[str, list[_Chunk]]]]:
    first, second = sources[pair.first], sources[pair.second]
    marks = shared_passages(fingerprints(first), fingerprints(second), pair.shared)
    for key, marked in zip((pair.first, pair.second), marks, strict=True):
        files = sorted({file for file, _ in marked})
        yield key, {file: _chunks(file, sources[key][file], marked) for file in files}


def _chunks(file: str, text: str, marks: Mapping[tuple[str, int], int]) -> list[_Chunk]:
    lines = enumerate(text.rstrip("\n").split("\n"), 1)
    grouped = groupby(lines, key=lambda line: marks.get((file, line[0])))
    return [(number, list(group)) for number, group in grouped]
