"""Words: a sentence that is said in one way to students of Python, and in another to those of C++.

Which of the two is said is decided while a submission is judged; see :func:`speaking`. So a text
is whole as soon as it is written, and nothing reads or changes it afterwards: names, numbers and
printed lines stand in it as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import ClassVar

from pydantic import ConfigDict

from grader.submission.record import CPP, PYTHON

_SPOKEN = ContextVar("language", default=PYTHON)


@dataclass(frozen=True)
class Words:
    """One sentence in the words of each language; as a text, in those of the one that is spoken."""

    __pydantic_config__: ClassVar = ConfigDict(
        extra="forbid", json_schema_extra={"x-words": "`{python: text, cpp: text}`"}
    )

    python: str
    cpp: str

    def __str__(self) -> str:
        """Say it."""
        return self.cpp if _SPOKEN.get() == CPP else self.python


@contextmanager
def speaking(language: str) -> Iterator[None]:
    """Say all words in this language meanwhile."""
    token = _SPOKEN.set(language)
    try:
        yield
    finally:
        _SPOKEN.reset(token)
