"""Mistakes that a check sees at once, by the table ``mistakes.yaml``."""

from __future__ import annotations

from pathlib import Path
from string import Template

from grader.findings.finding import Evidence, Finding
from grader.findings.words import TERMS, Words
from grader.spec.source import Model, read_source


class Row(Model):
    """An entry of the table: what is wrong, and what to try; see there."""

    mistake: str
    hint: str | Words
    only: str = ""


class Table(Model):
    """The whole of ``mistakes.yaml``: what they are about -> name -> the mistake."""

    mistakes: dict[str, dict[str, Row]]


TABLE = read_source(Path(__file__).with_name("mistakes.yaml")).read(Table).mistakes
_BY_NAME = {name: one for about in TABLE.values() for name, one in about.items()}


def mistaken(
    name: str, observed: str, evidence: Evidence | None = None, /, **values: str
) -> Finding:
    """The finding of a check that saw a mistake.

    Args:
        values: What stands for ``$name`` in the hint.
    """
    return Finding(observed, remedy(name, **values), evidence or Evidence())


def remedy(name: str, /, **values: str) -> str:
    """What to try after a mistake."""
    return Template(str(_BY_NAME[name].hint)).safe_substitute({**TERMS, **values})
