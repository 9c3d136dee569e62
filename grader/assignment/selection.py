"""A part of an assignment: some checks with all that they require, or some scenarios."""

from __future__ import annotations

import dataclasses
import math

from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Scenario, Visibility
from grader.assignment.withheld import Withheld
from grader.checks.check import Subject
from grader.errors import UsageError
from grader.spec.nearest_name import did_you_mean


def select(
    loaded: LoadedAssignment, checks: tuple[str, ...] = (), scenarios: tuple[str, ...] = ()
) -> LoadedAssignment:
    """Leave out what was not asked for.

    Args:
        checks: Judge only these and what they require; none means all.
        scenarios: Run only these; none means all that the checks need. A check whose
            scenarios are all left out is left out itself.

    Raises:
        UsageError: A name does not exist.
    """
    if not checks and not scenarios:
        return loaded
    known = {bound.spec.id: bound for bound in loaded.checks}
    _refuse_unknown("check", checks, set(known), loaded)
    named = {scenario.id for scenario in loaded.assignment.scenarios}
    _refuse_unknown("scenario", scenarios, named, loaded)
    wanted = _closure(loaded, checks) if checks else set(known)
    kept_scenarios = set(scenarios or named)
    kept = []
    for bound in loaded.checks:
        judged = [s.id for s in loaded.scenarios_of(bound) if s.id in kept_scenarios]
        if bound.spec.id not in wanted:
            continue
        if bound.check.subject is Subject.RECORDING and not judged:
            continue
        spec = bound.spec.model_copy(update={"scenarios": tuple(judged)})
        kept.append(dataclasses.replace(bound, spec=spec))
    ids = {bound.spec.id for bound in kept}
    kept = [
        dataclasses.replace(
            bound,
            spec=bound.spec.model_copy(
                update={"requires": tuple(r for r in bound.spec.requires if r in ids)}
            ),
        )
        for bound in kept
    ]
    assignment = loaded.assignment.model_copy(
        update={
            "checks": tuple(bound.spec for bound in kept),
            "scenarios": _needed(loaded, {s for b in kept for s in b.spec.scenarios}),
        }
    )
    return dataclasses.replace(loaded, assignment=assignment, checks=tuple(kept))


def visible_part(loaded: LoadedAssignment) -> LoadedAssignment:
    """What a student may see before grading: the visible checks, and the scenarios that they need.

    Nothing of the other checks is left but their number and points, so whatever is made from
    the part (recordings, grade, reports) cannot tell more.

    Args:
        loaded: The whole assignment; no visible check requires one that is not.

    Raises:
        UsageError: No check is visible.
    """
    specs = [bound.spec for bound in loaded.checks]
    visible = [spec for spec in specs if spec.visibility is Visibility.VISIBLE]
    hidden = [spec for spec in specs if spec.visibility is not Visibility.VISIBLE]
    if not hidden:
        return loaded
    if not visible:
        raise UsageError(
            f"assignment {loaded.assignment.id!r} has no visible check: everything is judged at "
            "grading, with --hidden"
        )
    withheld = Withheld(len(hidden), math.fsum(spec.points for spec in hidden))
    part = select(loaded, tuple(spec.id for spec in visible))
    return dataclasses.replace(part, withheld=loaded.withheld + withheld)


def _closure(loaded: LoadedAssignment, checks: tuple[str, ...]) -> set[str]:
    requires = {bound.spec.id: bound.spec.requires for bound in loaded.checks}
    wanted: set[str] = set()
    queue = list(checks)
    while queue:
        name = queue.pop()
        if name not in wanted:
            wanted.add(name)
            queue.extend(requires[name])
    return wanted


def _needed(loaded: LoadedAssignment, names: set[str]) -> tuple[Scenario, ...]:
    return tuple(s for s in loaded.assignment.scenarios if s.id in names)


def _refuse_unknown(
    kind: str, given: tuple[str, ...], known: set[str], loaded: LoadedAssignment
) -> None:
    for name in given:
        if name not in known:
            listed = f" There are: {', '.join(sorted(known))}."
            raise UsageError(
                f"assignment {loaded.assignment.id!r} has no {kind} {name!r}."
                + (did_you_mean(name, known) or listed)
            )
