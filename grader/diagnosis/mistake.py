"""What to try after a mistake, by the tables ``mistakes.yaml`` and ``hints.yaml``.

A check names a mistake that it sees at once, an explanation the one that it found.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from string import Template

from pydantic import RootModel

from grader.findings.finding import Evidence, Finding
from grader.findings.words import TERMS, Words
from grader.spec.source import Model, read_source


class Row(Model):
    """An entry of ``mistakes.yaml``: what is wrong, and what to try; see there."""

    mistake: str
    hint: str | Words
    only: str = ""


class Mistakes(Model):
    """The whole of ``mistakes.yaml``: what they are about -> name -> the mistake."""

    mistakes: dict[str, dict[str, Row]]


class Hints(RootModel[dict[str, dict[str, str | Words]]]):
    """The whole of ``hints.yaml``: module of explanations -> name -> what to try."""


@cache
def mistakes() -> dict[str, dict[str, Row]]:
    """What checks see at once. It is read when the first check fails."""
    return read_source(Path(__file__).with_name("mistakes.yaml")).read(Mistakes).mistakes


@cache
def hints() -> dict[str, str | Words]:
    """What to try, by the name of the mistake."""
    explained = read_source(Path(__file__).with_name("hints.yaml")).read(Hints).root.values()
    found = {name: hint for names in explained for name, hint in names.items()}
    return found | {name: one.hint for rows in mistakes().values() for name, one in rows.items()}


def mistaken(
    name: str, observed: str, evidence: Evidence | None = None, /, **values: object
) -> Finding:
    """The finding of a check that saw a mistake, or the cause that an explanation found.

    Args:
        values: What stands for ``$name`` in the hint.
    """
    return Finding(observed, remedy(name, **values), evidence or Evidence())


def remedy(name: str, /, **values: object) -> str:
    """What to try after a mistake."""
    return Template(str(hints()[name])).safe_substitute({**TERMS, **values})
