"""Mistakes that a check sees at once, by the table ``mistakes.yaml``."""

from __future__ import annotations

from pathlib import Path
from string import Template

from grader.findings.finding import Evidence, Finding
from grader.findings.words import (
    A_PROFILE,
    ARROW,
    EXCLUSIVE,
    LOG,
    REENTRANT,
    SILENT_EXCEPT,
    SLEEP,
    SPIN,
    SPIN_NODE,
    Words,
)
from grader.spec.source import Model, read_source


class Mistake(Model):
    """An entry of the table: what is wrong, and what to try; see there."""

    mistake: str
    hint: str | Words
    concept: str = ""
    only: str = ""


class Table(Model):
    """The whole of ``mistakes.yaml``: what they are about -> name -> the mistake."""

    mistakes: dict[str, dict[str, Mistake]]


TABLE = read_source(Path(__file__).with_name("mistakes.yaml")).read(Table).mistakes
_BY_NAME = {name: one for about in TABLE.values() for name, one in about.items()}
_TERMS = {
    **{"A_PROFILE": A_PROFILE, "ARROW": ARROW, "EXCLUSIVE": EXCLUSIVE, "LOG": LOG},
    **{"REENTRANT": REENTRANT, "SILENT_EXCEPT": SILENT_EXCEPT, "SLEEP": SLEEP},
    **{"SPIN": SPIN, "SPIN_NODE": SPIN_NODE},
}


def mistaken(
    name: str, observed: str, evidence: Evidence | None = None, /, **values: str
) -> Finding:
    """The finding of a check that saw a mistake.

    Args:
        values: What stands for ``$name`` in the hint.
    """
    hint, concept = remedy(name, **values), _BY_NAME[name].concept
    return Finding(observed, hint, evidence or Evidence(), concept=concept)


def remedy(name: str, /, **values: str) -> str:
    """What to try after a mistake."""
    hint = Template(str(_BY_NAME[name].hint)).safe_substitute(_TERMS)
    return Template(hint).safe_substitute(values)
