"""The catalogue of explanations, and the one loop that asks them.

A *symptom* is what a check saw: no message on a topic, a process that ended. An *explanation* is a
function from a symptom to its cause, or to None where it does not apply::

    @explanation(NoMessages)
    def other_type(symptom: NoMessages) -> Finding | None:
        \"\"\"The publisher has another message type.\"\"\"

It lies in any module of this package, and its docstring is its line in the documentation. It serves
the symptoms that are derived from its own, too. The deepest cause is asked first: in one module
they stand in this order, and one of another module says ``before=`` or ``after=`` which it is
asked. The general ones, which nearly always apply, follow after all others.

What to try is said by the name of the mistake: in ``hints.yaml`` for explanations, and in
``mistakes.yaml`` for what a check sees at once.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from string import Template
from typing import Any, ClassVar, Generic, TypeVar, cast

from pydantic import RootModel

from grader import diagnosis
from grader.findings.finding import Evidence, Finding, Status
from grader.findings.words import TERMS, Words
from grader.spec.source import Model, read_source

A = TypeVar("A")
S = TypeVar("S", bound="Symptom[Any]")
_DEFINED: list[Explanation] = []


class Symptom(Generic[A]):
    """What a check saw; its explanations answer with an ``A``, such as a cause."""

    concept: ClassVar[str] = ""
    """The page of ``docs/concepts`` for its causes, where an explanation declares no other."""

    def __init_subclass__(cls, *, concept: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        cls.concept = concept


@dataclass(frozen=True)
class Explanation:
    """One entry of the catalogue.

    Attributes:
        sentence: What it explains: the text of the documentation.
        example: How Python says it, or nothing.
        only: The one language of the programs that it explains, or nothing if any.
        before: Functions of other explanations that are asked later, if this one is asked.
        after: Those that are asked sooner.
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
    before: tuple[Callable[[Any], Any], ...] = ()
    after: tuple[Callable[[Any], Any], ...] = ()

    def follows(self, other: Explanation, *, is_later: bool) -> bool:
        """Whether it is asked after another one of its symptom.

        Args:
            is_later: Whether it is defined later than the other.
        """
        if self.is_general != other.is_general:
            return self.is_general
        is_below = is_later and self.module == other.module
        return is_below or other.apply in self.after or self.apply in other.before


def add(entry: Explanation) -> None:
    """Put an explanation into the catalogue."""
    _DEFINED.append(entry)


def explanation(
    *symptoms: type[Symptom[Any]],
    general: bool = False,
    before: tuple[Callable[[Any], Any], ...] = (),
    after: tuple[Callable[[Any], Any], ...] = (),
    only: str = "",
    concept: str = "",
) -> Callable[[Callable[[S], A]], Callable[[S], A]]:
    """Put a function into the catalogue.

    Args:
        symptoms: Which it explains.
        general: Asked after all others: it says only what is there in any case.
        before: Explanations of other modules that are asked later.
        after: Explanations of other modules that are asked sooner.
        only: The one language of the programs that it explains.
        concept: The page of ``docs/concepts`` that explains the idea.
    """

    def register(apply: Callable[[S], A]) -> Callable[[S], A]:
        sentence = " ".join((inspect.getdoc(apply) or "").split())
        for symptom in symptoms:
            name, module = apply.__name__, apply.__module__
            entry = Explanation(symptom, name, apply, module, sentence, general)
            page = concept or symptom.concept
            add(replace(entry, only=only, concept=page, before=before, after=after))
        return apply

    return register


@cache
def explanations() -> dict[type[Symptom[Any]], tuple[Explanation, ...]]:
    """All explanations by their symptom, in the order in which they are asked."""
    for module in walk_packages(diagnosis.__path__, f"{diagnosis.__name__}."):
        import_module(module.name)
    catalogue = {}
    for symptom in _derived(Symptom):
        entries = [entry for entry in _DEFINED if issubclass(symptom, entry.symptom)]
        if entries:
            catalogue[symptom] = tuple(in_order(entries))
    return catalogue


def _derived(symptom: type[Symptom[Any]]) -> Iterator[type[Symptom[Any]]]:
    for derived in symptom.__subclasses__():
        yield derived
        yield from _derived(derived)


def in_order(entries: Sequence[Explanation]) -> Iterator[Explanation]:
    """The explanations of one symptom as they are asked.

    Raises:
        LookupError: Nothing decides which of two is asked first.
    """
    sorter = TopologicalSorter[int]()
    for index, entry in enumerate(entries):
        earlier = [
            other_index
            for other_index, other in enumerate(entries)
            if other_index != index and entry.follows(other, is_later=index > other_index)
        ]
        sorter.add(index, *earlier)
    sorter.prepare()
    while sorter.is_active():
        ready = sorter.get_ready()
        if len(ready) > 1:
            names = [f"{entries[index].module}.{entries[index].name}" for index in ready]
            raise LookupError(f"say by before= or after= which is asked first: {', '.join(names)}")
        yield entries[ready[0]]
        sorter.done(ready[0])


def explain(symptom: Symptom[A]) -> A | None:
    """The deepest explanation of a symptom that applies, or None."""
    for entry in explanations()[type(symptom)]:
        answer = entry.apply(symptom)
        if isinstance(answer, Finding) and answer.status is Status.FAILED:
            answer = replace(answer, concept=answer.concept or entry.concept)
        if answer is not None:
            return cast(A, answer)
    return None


def cause_of(symptom: Symptom[A]) -> A:
    """The deepest explanation of a symptom of which one always applies."""
    answer = explain(symptom)
    assert answer is not None, symptom
    return answer


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
    hints_by_module = read_source(Path(__file__).with_name("hints.yaml")).read(Hints).root
    by_name: dict[str, str | Words] = {}
    for of_module in hints_by_module.values():
        by_name |= of_module
    for rows in mistakes().values():
        by_name |= {name: row.hint for name, row in rows.items()}
    return by_name


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
