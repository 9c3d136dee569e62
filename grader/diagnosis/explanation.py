"""The catalogue of explanations, and the one loop that asks them.

A *symptom* is what a check saw: no message on a topic, a process that ended. An *explanation* is a
function from a symptom to its cause, or to None where it does not apply::

    @explanation(NoMessages)
    def other_type(symptom: NoMessages) -> Cause | None:
        \"\"\"The publisher has another message type.\"\"\"

It lies in any module of this package, and its docstring is its line in the documentation. Those in
the module of the symptom are asked first, in the order of their definition: the deepest cause comes
first. Those of other modules follow, and after them the general ones, which nearly always apply.
"""

from __future__ import annotations

import inspect
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pkgutil import walk_packages
from typing import Any, TypeVar

from grader import diagnosis
from grader.diagnosis.cause import Cause

S = TypeVar("S")
_DEFINED: list[Explanation] = []


@dataclass(frozen=True)
class Explanation:
    """One entry of the catalogue."""

    symptom: type[Any]
    apply: Callable[[Any], Cause | None]
    is_general: bool

    @property
    def name(self) -> str:
        """Such as ``no_messages.other_type``."""
        return f"{self.apply.__module__.rpartition('.')[2]}.{self.apply.__name__}"

    @property
    def sentence(self) -> str:
        """What it explains, in one sentence."""
        return " ".join((inspect.getdoc(self.apply) or "").split())


def explanation(
    symptom: type[S], *, general: bool = False
) -> Callable[[Callable[[S], Cause | None]], Callable[[S], Cause | None]]:
    """Put a function into the catalogue.

    Args:
        general: Asked after all others: it says only what is there in any case.
    """

    def register(apply: Callable[[S], Cause | None]) -> Callable[[S], Cause | None]:
        _DEFINED.append(Explanation(symptom, apply, general))
        return apply

    return register


@cache
def explanations() -> dict[type[Any], tuple[Explanation, ...]]:
    """All explanations by their symptom, in the order in which they are asked."""
    for module in walk_packages(diagnosis.__path__, f"{diagnosis.__name__}."):
        import_module(module.name)
    found: dict[type[Any], list[Explanation]] = defaultdict(list)
    for entry in _DEFINED:
        found[entry.symptom].append(entry)
    return {
        symptom: tuple(
            sorted(
                entries,
                key=lambda one: (one.is_general, one.apply.__module__ != symptom.__module__),
            )
        )
        for symptom, entries in found.items()
    }


def explain(symptom: object) -> Cause | None:
    """The deepest cause of a symptom that can be seen, or None."""
    for entry in explanations()[type(symptom)]:
        cause = entry.apply(symptom)
        if cause is not None:
            return cause
    return None


def cause_of(symptom: object) -> Cause:
    """The cause of a symptom that has an explanation that always applies."""
    cause = explain(symptom)
    assert cause is not None, symptom
    return cause
