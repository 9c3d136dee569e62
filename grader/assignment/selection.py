"""A part of an assignment: some checks with all that they require, or some scenarios."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping

from grader.assignment.contract.expand import expanded_with
from grader.assignment.load import LoadedAssignment, bound_checks
from grader.assignment.model import Visibility, Withheld
from grader.assignment.repeat import with_runs
from grader.assignment.variable import Values
from grader.checks.check import Subject
from grader.errors import AssignmentError, UsageError
from grader.spec.nearest_name import nearest_or_all


def select(
    loaded: LoadedAssignment, checks: tuple[str, ...] = (), scenarios: tuple[str, ...] = ()
) -> LoadedAssignment:
    """Leave out what was not asked for.

    Args:
        checks: Judge only these and what they require; none means all.
        scenarios: Run only these; none means all that the checks need. A check whose
            scenarios are all left out is left out itself.
    """
    if not checks and not scenarios:
        return loaded
    requires = {bound.spec.id: bound.spec.requires for bound in loaded.checks}
    every_scenario = [scenario.id for scenario in loaded.assignment.scenarios]
    _refuse_unknown("check", checks, requires, loaded)
    _refuse_unknown("scenario", scenarios, every_scenario, loaded)
    chosen_checks = set(checks or requires)
    for name in checks:
        chosen_checks |= required_by(name, requires)
    chosen_scenarios = scenarios or every_scenario
    judged_in = {}
    for bound in loaded.checks:
        ids = [scenario.id for scenario in loaded.scenarios_of(bound)]
        ids = [scenario for scenario in ids if scenario in chosen_scenarios]
        # What is handed in is judged without any run.
        needs_none = bound.check.subject is Subject.SUBMISSION
        if bound.spec.id in chosen_checks and (ids or needs_none):
            judged_in[bound.spec.id] = tuple(ids)
    parts = []
    for bound in loaded.checks:
        if bound.spec.id in judged_in:
            required = tuple(check for check in bound.spec.requires if check in judged_in)
            changes = {"scenarios": judged_in[bound.spec.id], "requires": required}
            parts.append(dataclasses.replace(bound, spec=bound.spec.model_copy(update=changes)))
    needed = {scenario for bound in parts for scenario in bound.spec.scenarios}
    assignment = loaded.assignment.model_copy(
        update={
            "checks": tuple(bound.spec for bound in parts),
            "scenarios": tuple(s for s in loaded.assignment.scenarios if s.id in needed),
        }
    )
    return dataclasses.replace(loaded, assignment=assignment, checks=tuple(parts))


def required_by(check: str, requires: Mapping[str, tuple[str, ...]]) -> set[str]:
    """Everything that a check requires, directly or not; without itself."""
    required: set[str] = set()
    waiting = list(requires.get(check, ()))
    while waiting:
        name = waiting.pop()
        if name not in required:
            required.add(name)
            waiting.extend(requires.get(name, ()))
    return required - {check}


def visible_part(loaded: LoadedAssignment) -> LoadedAssignment:
    """What a student may see before grading: the visible checks, and the scenarios that they need.

    Of the other checks only their number and points are left, so recordings, grade and reports
    cannot reveal more.

    Args:
        loaded: The whole assignment; no visible check requires one that is not.
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
    withheld = Withheld(checks=len(hidden), points=math.fsum(spec.points for spec in hidden))
    part = select(loaded, tuple(spec.id for spec in visible))
    return dataclasses.replace(part, withheld=loaded.withheld + withheld)


def with_values(loaded: LoadedAssignment, values: Values) -> LoadedAssignment:
    """The same part of an assignment with other values in the places of its variables.

    Raises:
        AssignmentError: A name is not possible where it stands.
    """
    if loaded.source is None or values == loaded.values:
        return loaded
    source = expanded_with(loaded.source, values)
    assignment, bound, problems = bound_checks(source)
    if problems:
        raise AssignmentError(source.file, problems)
    assignment, checks = with_runs(assignment, [check for check in bound if check is not None])
    whole = dataclasses.replace(loaded, assignment=assignment, checks=checks, values=values)
    return select(
        whole,
        tuple(check.spec.id for check in loaded.checks),
        tuple(scenario.id for scenario in loaded.assignment.scenarios),
    )


def _refuse_unknown(
    kind: str, given: tuple[str, ...], known: Collection[str], loaded: LoadedAssignment
) -> None:
    for name in given:
        if name not in known:
            advice = nearest_or_all(name, sorted(known))
            raise UsageError(f"assignment {loaded.assignment.id!r} has no {kind} {name!r}.{advice}")
