"""The checks of an assignment, bound to the catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from grader.assignment.model import CheckSpec
from grader.assignment.own_check import load_own_check
from grader.checks.check import Check, Parameters
from grader.errors import Problem
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Source


@dataclass(frozen=True)
class BoundCheck:
    """A check of an assignment, ready to judge.

    Attributes:
        parameters: Its ``with``, validated by the check's own model.
        partial: Share of the points -> parameters that give it; the largest share first.
    """

    spec: CheckSpec
    check: Check
    parameters: Parameters
    partial: tuple[tuple[float, Parameters], ...] = ()

    @property
    def title(self) -> str:
        """One line for the student: the author's, or the check's own."""
        own = f"{self.check.title} ({self.spec.robot})" if self.spec.robot else self.check.title
        return self.spec.title or own


def bind(
    source: Source, index: int, spec: CheckSpec, catalogue: Mapping[str, Check]
) -> tuple[BoundCheck | None, list[Problem]]:
    """Find the check that an entry uses, and read its parameters; or say why not."""
    place = ("checks", index)
    if spec.python is not None:
        try:
            check = load_own_check(spec.python, source.file.parent)
        except ValueError as error:
            return None, [source.problem((*place, "python"), str(error))]
    elif spec.uses in catalogue:
        check = catalogue[str(spec.uses)]
    else:
        advice = nearest_or_all(str(spec.uses), sorted(catalogue), "The checks are")
        text = f"there is no check {spec.uses!r}.{advice}"
        return None, [source.problem((*place, "uses"), text)]
    parameters, problems = source.examine(check.parameters, (*place, "with"))
    if parameters is None:
        return None, problems
    looser: list[tuple[float, Parameters]] = []
    for number, partial in enumerate(spec.partial):
        where = (*place, "partial", number, "with")
        changed, mistakes = source.examine(check.parameters, where, base=(*place, "with"))
        problems += mistakes
        if changed is not None:
            looser.append((partial.share, changed))
    looser.sort(key=lambda item: -item[0])
    return BoundCheck(spec, check, parameters, tuple(looser)), problems
