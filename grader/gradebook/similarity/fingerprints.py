"""Fingerprints of source code that stay the same when names, formatting and comments change.

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

from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from typing import NamedTuple
from zlib import crc32

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
    found: dict[int, list[Gram]] = defaultdict(list)
    for row in _rows(files):
        chosen = None
        for start in range(max(1, len(row) - WINDOW + 1)):
            # The last of equals stays the smallest for longest.
            smallest = min(row[start : start + WINDOW], key=lambda one: (one[0], -one[1].token))
            if smallest is not chosen:
                chosen = smallest
                found[chosen[0]].append(chosen[1])
    return found


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
        runs = (tokens[start : start + RUN] for start in range(len(tokens) - RUN + 1))
        row = [
            (crc32(" ".join(token for token, _ in run).encode()), Gram(file, start, first, last))
            for start, run in enumerate(runs)
            for first, last in [(run[0][1], run[-1][1])]
        ]
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
    at, before = 0, ""
    for _, kind, value in get_lexer_by_name(language).get_tokens_unprocessed(code):
        token = value.strip()
        if kind in Name or kind in Number:
            token = "name" if kind in Name else "number"
        elif kind in String and token:
            # A string comes in pieces.
            token = "string" if kind is not String.Doc and before != "string" else ""
        if token and kind not in Comment and token not in _LEFT_OUT:
            yield token, lines[at][0]
            before = token
        at += value.count("\n")
