"""The words of a student's language: findings are written in Python's, and put into those of C++.

``cpp_words.yaml`` is the table. Nothing else translates.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import yaml

from grader.findings.finding import Finding

_FILE = Path(__file__).with_name("cpp_words.yaml")
_PLACE = re.compile(r"(?<!\$)\{(\w+)\}")


@cache
def _table() -> tuple[list[str], re.Pattern[str]]:
    """The words of C++ of each row, and what finds those of Python: ``row_0`` is the first."""
    # Read late: most submissions are in Python.
    rows = yaml.safe_load(_FILE.read_text(encoding="utf-8"))["words"]
    patterns = [_pattern(number, row["python"]) for number, row in enumerate(rows)]
    return [row["cpp"] for row in rows], re.compile("|".join(patterns))


def _pattern(number: int, python: str) -> str:
    """A regular expression for the words of one row, in which ``{name}`` stands for any text."""
    literal, *rest = _PLACE.split(python)
    found = re.escape(literal)
    for name, after in zip(rest[::2], rest[1::2], strict=True):
        found += rf"(?P<{name}_{number}>(?:[^()]|\([^()]*\))+?){re.escape(after)}"
    # A word is not replaced within a longer one.
    begin = r"(?<![\w.])" if python[0].isalnum() else ""
    end = r"(?!\w)" if python[-1].isalnum() else ""
    return f"{begin}(?P<row_{number}>{found}){end}"


def in_cpp(text: str) -> str:
    """A text in the words of C++; where several rows match, the first wins."""
    cpp, pattern = _table()

    def translated(found: re.Match[str]) -> str:
        number = next(n for n in range(len(cpp)) if found[f"row_{n}"] is not None)
        return _PLACE.sub(lambda place: in_cpp(found[f"{place[1]}_{number}"]), cpp[number])

    return pattern.sub(translated, text)


def finding_in_cpp(finding: Finding) -> Finding:
    """A finding in the words of C++; evidence is the student's, and stays as it is."""
    return replace(
        finding,
        expected=in_cpp(finding.expected),
        observed=in_cpp(finding.observed),
        hint=in_cpp(finding.hint),
    )
