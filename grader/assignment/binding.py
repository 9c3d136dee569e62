"""The checks of an assignment, bound to the catalogue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

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
        about: What tells it apart from checks of the same title, such as its topic; or nothing.
    """

    spec: CheckSpec
    check: Check
    parameters: Parameters
    about: str = ""

    @property
    def title(self) -> str:
        """One line for the student: the author's, or the check's own."""
        own = f"{self.check.title}: {self.about}" if self.about else self.check.title
        return self.spec.title or own


def tell_apart(checks: Sequence[BoundCheck]) -> list[BoundCheck]:
    """Name in the titles of checks that would have the same what each is about.

    That is the first text among their parameters that differs, such as the topic, or the
    scenarios that they name.
    """
    groups: dict[str, list[BoundCheck]] = {}
    for bound in checks:
        groups.setdefault(bound.title, []).append(bound)
    return [replace(bound, about=_about(bound, groups[bound.title])) for bound in checks]


def _about(bound: BoundCheck, alike: Sequence[BoundCheck]) -> str:
    if len(alike) == 1 or bound.spec.title:
        return ""
    for key in type(bound.parameters).model_fields:
        texts = [getattr(one.parameters, key, None) for one in alike]
        mine = getattr(bound.parameters, key)
        if isinstance(mine, str) and texts.count(mine) < len(texts):
            return str(mine)
    return ", ".join(bound.spec.scenarios)


def bind(
    source: Source, index: int, spec: CheckSpec, catalogue: Mapping[str, Check]
) -> tuple[BoundCheck | None, list[Problem]]:
    """Find the check that an entry uses, and read its parameters; or say why not."""
    place = ("checks", index)
    if spec.python is not None:
        try:
            found = load_own_check(spec.python, source.file.parent)
        except ValueError as error:
            return None, [source.problem((*place, "python"), str(error))]
    elif spec.uses in catalogue:
        found = catalogue[str(spec.uses)]
    else:
        advice = nearest_or_all(str(spec.uses), sorted(catalogue), "The checks are")
        text = f"there is no check {spec.uses!r}.{advice}"
        return None, [source.problem((*place, "uses"), text)]
    parameters, problems = source.examine(found.parameters, (*place, "with"))
    if parameters is None:
        return None, problems
    return BoundCheck(spec, found, parameters), []
