"""Pairs of submissions that share what few others of their class have, and where they share it."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import combinations, pairwise

from grader.gradebook.similarity.fingerprints import RUN, WINDOW, Fingerprints, Gram

THRESHOLD = 0.4
"""Least share of the smaller submission's fingerprints. Of 117 right solutions of rosgrade's own
assignments, 113 are found again when renamed, reordered and reformatted; different solutions are
pairs only where they share whole lines or differ in texts alone; others have at most 0.25."""
FEWEST = 8
"""Least number of shared fingerprints: what is left of a short exercise is alike by chance."""
_COMMON_SHARE = 0.25
_FEW, _MANY = 5, 40


@dataclass(frozen=True)
class Pair:
    """Two submissions that are alike.

    Attributes:
        score: Share of the smaller one's own fingerprints that are shared, 0 to 1.
        shared: Fingerprints that both have.
    """

    first: str
    second: str
    score: float
    shared: frozenset[int]


Marks = dict[tuple[str, int], int]
"""The number of the shared passage that a line belongs to, by file and line."""


def find_pairs(submissions: Mapping[str, Collection[int]], teams: Mapping[str, str]) -> list[Pair]:
    """The pairs that are most alike, the most alike first.

    What more than a quarter of the class has comes from the lecture or is usual, and does not
    count: more than 5 submissions of a small class, more than 40 of a large one.

    Args:
        submissions: Fingerprints by key, without those of the starter and the reference.
        teams: Of those who worked together: the team by key. A team is not compared with itself.
    """
    most = min(max(_FEW, int(_COMMON_SHARE * len(submissions))), _MANY)
    holders: dict[int, list[str]] = defaultdict(list)
    for key in sorted(submissions):
        for code in submissions[key]:
            holders[code].append(key)
    rare = {code: keys for code, keys in holders.items() if len(keys) <= most}
    own = Counter(key for keys in rare.values() for key in keys)
    shared: dict[tuple[str, str], list[int]] = defaultdict(list)
    for code, keys in rare.items():
        for pair in combinations(keys, 2):
            shared[pair].append(code)
    found = [
        Pair(first, second, len(codes) / min(own[first], own[second]), frozenset(codes))
        for (first, second), codes in shared.items()
        if len(codes) >= FEWEST and (first not in teams or teams[first] != teams.get(second))
    ]
    alike = [pair for pair in found if pair.score >= THRESHOLD]
    return sorted(alike, key=lambda one: (-one.score, -len(one.shared), one.first, one.second))


def shared_passages(
    first: Fingerprints, second: Fingerprints, shared: Collection[int]
) -> tuple[Marks, Marks]:
    """Where each of two submissions has the passages that they share; 1 is the longest."""
    # Fingerprints of one passage are as far apart in one program as in the other.
    rows: dict[tuple[str, str, int], list[tuple[Gram, Gram]]] = defaultdict(list)
    for code in shared:
        for one, other in zip(first[code], second[code], strict=False):
            rows[one.file, other.file, one.token - other.token].append((one, other))
    passages: list[list[tuple[Gram, Gram]]] = []
    for row in map(sorted, rows.values()):
        passages.append(row[:1])
        for before, grams in pairwise(row):
            if grams[0].token - before[0].token > RUN + WINDOW:
                passages.append([])
            passages[-1].append(grams)
    marks: tuple[Marks, Marks] = ({}, {})
    number = 1
    for passage in sorted(passages, key=lambda one: (-len(one), one[0])):
        fresh = [
            [line for line in _lines(passage, side) if line not in marks[side]] for side in (0, 1)
        ]
        if all(fresh):
            for side, lines in enumerate(fresh):
                marks[side].update(dict.fromkeys(lines, number))
            number += 1
    return marks


def _lines(passage: list[tuple[Gram, Gram]], side: int) -> list[tuple[str, int]]:
    start, end = passage[0][side], passage[-1][side]
    return [(start.file, line) for line in range(start.first, end.last + 1)]
