"""Which submissions of a class are alike, after renaming and reformatting, and the page of them.

A program becomes a row of tokens in which every name is the same token, and so is every number and
every string; imports, comments, docstrings, white space, commas and braces are left out. Of the
hashes of all runs of ``RUN`` tokens, winnowing keeps the smallest of each ``WINDOW`` neighbours, so
two programs that share ``RUN + WINDOW - 1`` tokens in a row share a fingerprint for certain.

Schleimer, Wilkerson and Aiken, "Winnowing: Local Algorithms for Document Fingerprinting",
SIGMOD 2003, https://theory.stanford.edu/~aiken/publications/papers/sigmod03.pdf

Of the tools that do this, compare50 is under the GPL, which is not for a program under Apache-2.0,
and copydetect needs matplotlib.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby, pairwise
from pathlib import PurePosixPath
from typing import NamedTuple
from zlib import crc32

from grader.report.html.page import render_page

RUN = 12
WINDOW = 4
LONGEST_FILE = 64 * 1024
MOST_CHARACTERS = 512 * 1024
"""Of code that is read of one submission; no student writes so much by hand, or so long a file."""
_CPP = (".c", ".cc", ".cpp", ".cxx", ".h", ".hh", ".hpp", ".hxx")
_LANGUAGES = {".py": "python", **dict.fromkeys(_CPP, "cpp")}
_LEFT_OUT = frozenset(",{}")
_IMPORTS = ("import ", "from ", "using ")


class Gram(NamedTuple):
    """A run of tokens: its file, the number of its first token, its first and last line."""

    file: str
    token: int
    first: int
    last: int


Fingerprints = Mapping[int, list[Gram]]
"""Where each fingerprint of a submission is."""


def fingerprints(files: Mapping[str, str]) -> Fingerprints:
    """The fingerprints of a submission's programs, given by their paths."""
    places: dict[int, list[Gram]] = defaultdict(list)
    for row in _rows(files):
        chosen = None
        for start in range(max(1, len(row) - WINDOW + 1)):
            # The last of equals stays the smallest for longest.
            smallest = min(row[start : start + WINDOW], key=lambda item: (item[0], -item[1].token))
            if smallest is not chosen:
                chosen = smallest
                places[chosen[0]].append(chosen[1])
    return places


def all_hashes(files: Mapping[str, str]) -> set[int]:
    """The hashes of all runs of tokens, of what every student may know."""
    return {code for row in _rows(files) for code, _ in row}


def _rows(files: Mapping[str, str]) -> Iterator[list[tuple[int, Gram]]]:
    """For each program: the hash of each run of tokens, and where it is."""
    left = MOST_CHARACTERS
    for file, text in files.items():
        language = _LANGUAGES.get(PurePosixPath(file).suffix.lower())
        if language is None or len(text) > min(left, LONGEST_FILE):
            continue
        left -= len(text)
        tokens = list(_tokens(text, language))
        row = []
        for start in range(len(tokens) - RUN + 1):
            run = tokens[start : start + RUN]
            code = crc32(" ".join(token for token, _ in run).encode())
            row.append((code, Gram(file, start, first=run[0][1], last=run[-1][1])))
        if row:
            yield row


def _tokens(text: str, language: str) -> Iterator[tuple[str, int]]:
    """Normal tokens, with their lines."""
    from pygments.lexers import get_lexer_by_name
    from pygments.token import Comment, Name, Number, String

    # Lexers take quadratic time for blank lines; imports are alike in all programs.
    lines = [(number, line.strip()) for number, line in enumerate(text.split("\n"), 1)]
    lines = [one for one in lines if one[1] and not one[1].startswith(_IMPORTS)]
    code = "\n".join(line for _, line in lines)
    index, before = 0, ""
    for _, kind, value in get_lexer_by_name(language).get_tokens_unprocessed(code):
        token = value.strip()
        if kind in Name or kind in Number:
            token = "name" if kind in Name else "number"
        elif kind in String and token:
            # A string comes in pieces.
            token = "string" if kind is not String.Doc and before != "string" else ""
        if token and kind not in Comment and token not in _LEFT_OUT:
            yield token, lines[index][0]
            before = token
        index += value.count("\n")


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
    rare_counts = Counter(key for keys in rare.values() for key in keys)
    shared: dict[tuple[str, str], list[int]] = defaultdict(list)
    for code, keys in rare.items():
        for pair in combinations(keys, 2):
            shared[pair].append(code)
    alike = []
    for (first, second), codes in shared.items():
        are_team = first in teams and teams[first] == teams.get(second)
        score = len(codes) / min(rare_counts[first], rare_counts[second])
        if len(codes) >= FEWEST and score >= THRESHOLD and not are_team:
            alike.append(Pair(first, second, score, frozenset(codes)))
    return sorted(alike, key=lambda pair: (-pair.score, -len(pair.shared), pair.first, pair.second))


def shared_passages(
    first: Fingerprints, second: Fingerprints, shared: Collection[int]
) -> tuple[Marks, Marks]:
    """Where each of two submissions has the passages that they share; 1 is the longest."""
    # Fingerprints of one passage are as far apart in one program as in the other.
    rows: dict[tuple[str, str, int], list[tuple[Gram, Gram]]] = defaultdict(list)
    for code in shared:
        for gram, other in zip(first[code], second[code], strict=False):
            rows[gram.file, other.file, gram.token - other.token].append((gram, other))
    passages: list[list[tuple[Gram, Gram]]] = []
    for row in map(sorted, rows.values()):
        passages.append(row[:1])
        for before, grams in pairwise(row):
            if grams[0].token - before[0].token > RUN + WINDOW:
                passages.append([])
            passages[-1].append(grams)
    marks: tuple[Marks, Marks] = ({}, {})
    number = 1
    for passage in sorted(passages, key=lambda grams: (-len(grams), grams[0])):
        in_first = [line for line in _lines(passage, 0) if line not in marks[0]]
        in_second = [line for line in _lines(passage, 1) if line not in marks[1]]
        if in_first and in_second:
            marks[0].update(dict.fromkeys(in_first, number))
            marks[1].update(dict.fromkeys(in_second, number))
            number += 1
    return marks


def _lines(passage: list[tuple[Gram, Gram]], side: int) -> list[tuple[str, int]]:
    start, end = passage[0][side], passage[-1][side]
    return [(start.file, line) for line in range(start.first, end.last + 1)]


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
