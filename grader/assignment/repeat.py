"""Scenarios that are run several times: each run is a scenario of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from grader.assignment.binding import BoundCheck
from grader.assignment.model import Assignment, Scenario


def runs_of(scenario: Scenario) -> tuple[str, ...]:
    """Ids of the runs of a scenario: ``drive_1``, ``drive_2``, ...; its own if it is run once."""
    if scenario.repeat == 1:
        return (scenario.id,)
    return tuple(f"{scenario.id}_{number}" for number in range(1, scenario.repeat + 1))


def with_runs(
    assignment: Assignment, bound: Sequence[BoundCheck]
) -> tuple[Assignment, tuple[BoundCheck, ...]]:
    """The same assignment with each run as a scenario, in checks that name the scenario too."""
    runs = {scenario.id: runs_of(scenario) for scenario in assignment.scenarios}
    checks = []
    for one in bound:
        judged = tuple(run for name in one.spec.scenarios for run in runs[name])
        checks.append(replace(one, spec=one.spec.model_copy(update={"scenarios": judged})))
    scenarios = tuple(
        scenario.model_copy(update={"id": run, "repeat": 1})
        for scenario in assignment.scenarios
        for run in runs[scenario.id]
    )
    changes = {"scenarios": scenarios, "checks": tuple(one.spec for one in checks)}
    return assignment.model_copy(update=changes), tuple(checks)
