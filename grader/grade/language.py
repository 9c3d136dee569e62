"""The words of a student's language: findings are written in Python's, and put into those of C++.

``cpp_words.yaml`` is the table. Nothing else translates.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from grader.findings.finding import Finding
from grader.spec.source import Model, read_source
from grader.submission.record import CPP, SubmissionRecord

_PLACE = re.compile(r"(?<!\$)\{(\w+)\}")


class Words(Model):
    """One row of the table; ``{name}`` stands for any text, the same on both sides."""

    python: str
    cpp: str

    def pattern(self, number: int) -> str:
        """A regular expression for the words of Python, as a group of this number."""
        literal, *rest = _PLACE.split(self.python)
        found = re.escape(literal)
        for name, after in zip(rest[::2], rest[1::2], strict=True):
            found += rf"(?P<{name}_{number}>(?:[^()]|\([^()]*\))+?){re.escape(after)}"
        # A word is not replaced within a longer one.
        begin = r"(?<![\w.])" if self.python[0].isalnum() else ""
        end = r"(?!\w)" if self.python[-1].isalnum() else ""
        return f"{begin}(?P<row_{number}>{found}){end}"


class WordTable(Model):
    """The whole of ``cpp_words.yaml``; where several rows match, the first wins."""

    words: tuple[Words, ...]


WORDS = read_source(Path(__file__).with_name("cpp_words.yaml")).read(WordTable).words
_ANY = re.compile("|".join(row.pattern(number) for number, row in enumerate(WORDS)))


def in_cpp(text: str) -> str:
    """A text in the words of C++."""
    return _ANY.sub(_translated, text)


def _translated(found: re.Match[str]) -> str:
    number = next(n for n in range(len(WORDS)) if found[f"row_{n}"] is not None)
    return _PLACE.sub(lambda place: in_cpp(found[f"{place[1]}_{number}"]), WORDS[number].cpp)


def is_cpp(submission: SubmissionRecord, names: Collection[str]) -> bool:
    """Whether packages are written in C++; if they have no programs, the whole submission."""
    spoken = {one.name: submission.language(one) for one in submission.packages}
    named = {language for name, language in spoken.items() if name in names} - {""}
    return (named or {*spoken.values()} - {""}) == {CPP}


def finding_in_cpp(finding: Finding) -> Finding:
    """A finding in the words of C++; evidence is the student's, and stays as it is."""
    return replace(
        finding,
        expected=in_cpp(finding.expected),
        observed=in_cpp(finding.observed),
        hint=in_cpp(finding.hint),
    )
