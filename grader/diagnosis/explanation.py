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
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pkgutil import walk_packages
from typing import Any, ClassVar, Generic, TypeVar, cast

from grader import diagnosis
from grader.diagnosis.cause import Cause

A = TypeVar("A")
S = TypeVar("S", bound="Symptom[Any]")
_DEFINED: list[Explanation] = []


class Symptom(Generic[A]):
    """What a check saw; its explanations answer with an ``A``, such as a cause."""

    concept: ClassVar[str] = ""
    """The page of ``docs/concepts`` for its causes, where an explanation declares no other."""

    def __init_subclass__(cls, *, concept: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        cls.concept = concept or cls.concept


@dataclass(frozen=True)
class Explanation:
    """One entry of the catalogue.

    Attributes:
        sentence: What it explains: the text of the documentation.
        example: How Python says it, or nothing.
        only: The one language of the programs that it explains, or nothing if any.
    """

    symptom: type[Symptom[Any]]
    name: str
    apply: Callable[[Any], Any]
    module: str
    sentence: str
    is_general: bool = False
    example: str = ""
    only: str = ""
    concept: str = ""


def add(entry: Explanation) -> None:
    """Put an explanation into the catalogue."""
    _DEFINED.append(entry)


def explanation(
    *symptoms: type[Symptom[Any]], general: bool = False, only: str = "", concept: str = ""
) -> Callable[[Callable[[S], A]], Callable[[S], A]]:
    """Put a function into the catalogue.

    Args:
        symptoms: Which it explains.
        general: Asked after all others: it says only what is there in any case.
        only: The one language of the programs that it explains.
        concept: The page of ``docs/concepts`` that explains the idea.
    """

    def register(apply: Callable[[S], A]) -> Callable[[S], A]:
        sentence = " ".join((inspect.getdoc(apply) or "").split())
        for symptom in symptoms:
            name, module = apply.__name__, apply.__module__
            entry = Explanation(symptom, name, apply, module, sentence, general)
            add(replace(entry, only=only, concept=concept or symptom.concept))
        return apply

    return register


@cache
def explanations() -> dict[type[Symptom[Any]], tuple[Explanation, ...]]:
    """All explanations by their symptom, in the order in which they are asked."""
    for module in walk_packages(diagnosis.__path__, f"{diagnosis.__name__}."):
        import_module(module.name)
    found: dict[type[Symptom[Any]], list[Explanation]] = defaultdict(list)
    for entry in _DEFINED:
        found[entry.symptom].append(entry)
    return {
        symptom: tuple(
            sorted(
                entries,
                key=lambda one: (one.is_general, one.module != symptom.__module__),
            )
        )
        for symptom, entries in found.items()
    }


def explain(symptom: Symptom[A]) -> A | None:
    """The deepest explanation of a symptom that applies, or None."""
    for entry in explanations()[type(symptom)]:
        answer = entry.apply(symptom)
        if isinstance(answer, Cause) and not answer.concept:
            answer = replace(answer, concept=entry.concept)
        if answer is not None:
            return cast(A, answer)
    return None


def cause_of(symptom: Symptom[A]) -> A:
    """The same of a symptom that has an explanation that always applies."""
    answer = explain(symptom)
    assert answer is not None, symptom
    return answer
