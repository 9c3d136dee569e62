"""What must fit together in an assignment, beyond the form of each value; pure but for ruff.

That is what the YAML names elsewhere in itself, and what checks declare to need. Two parts are in
modules of their own: :mod:`grader.assignment.scenario_rules` and
:mod:`grader.assignment.need_rules`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter

from grader.assignment.binding import BoundCheck
from grader.assignment.model import SHOWN_FROM, Assignment, CheckSpec, Launch, Scenario
from grader.assignment.need_rules import unmet_needs
from grader.assignment.repeat import runs_of
from grader.assignment.scenario_rules import KnownPackages, Mistakes, scenario_mistakes
from grader.checks.check import Subject
from grader.errors import Problem
from grader.findings.reference import Goal
from grader.spec.document import Place
from grader.spec.name import package_name
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Source
from grader.spec.unit import format_duration


def problems(
    source: Source, assignment: Assignment, checks: Sequence[BoundCheck | None]
) -> Iterator[Problem]:
    """Find everything that does not fit together."""
    for name, *keys in (("name", "packages"), ("id", "scenarios"), ("id", "checks", "manual")):
        yield from source.duplicates(name, *keys)
    yield from _packages(source, assignment)
    packages = KnownPackages.of(source, assignment)
    for index, scenario in enumerate(assignment.scenarios):
        for place, text in (
            *_names_of_runs(scenario, assignment),
            *scenario_mistakes(scenario, packages),
        ):
            yield source.problem(("scenarios", index, *place), text)
    yield from _requirements(source, assignment.checks)
    yield from _points(source, assignment)
    for index, check in enumerate(checks):
        if check is not None:
            for place, text in _check(assignment, check):
                yield source.problem(("checks", index, *place), text)


def _packages(source: Source, assignment: Assignment) -> Iterator[Problem]:
    reads_bags_only = all(scenario.bag is not None for scenario in assignment.scenarios)
    if not assignment.packages and not (assignment.scenarios and reads_bags_only):
        yield source.problem((), "the key 'packages' is missing")
    for index, package in enumerate(assignment.packages):
        try:
            package_name(package.name)
        except ValueError as error:
            yield source.problem(("packages", index, "name"), str(error))


def _names_of_runs(scenario: Scenario, assignment: Assignment) -> Mistakes:
    """Runs of a repeated scenario that would be called like another scenario."""
    others = {other.id for other in assignment.scenarios} - {scenario.id}
    for run in sorted(others.intersection(runs_of(scenario))):
        yield ("repeat",), f"a run of {scenario.id!r} would be called as the scenario {run!r}"


def _requirements(source: Source, checks: Sequence[CheckSpec]) -> Iterator[Problem]:
    visibility = {spec.id: spec.visibility for spec in checks}
    for index, spec in enumerate(checks):
        for number, required in enumerate(spec.requires):
            place: Place = ("checks", index, "requires", number)
            if required not in visibility:
                advice = nearest_or_all(required, visibility, "The checks are")
                yield source.problem(place, f"there is no check {required!r}.{advice}")
            # Else a student would see a skipped check without its reason.
            elif SHOWN_FROM.index(visibility[required]) > SHOWN_FROM.index(spec.visibility):
                text = (
                    f"{required!r} is {visibility[required].value!r}, so {spec.id!r} cannot be "
                    f"{spec.visibility.value!r}: a student would lose its points for a reason that "
                    "is not shown"
                )
                yield source.problem(place, text)
    try:
        TopologicalSorter({spec.id: spec.requires for spec in checks}).prepare()
    except CycleError as error:
        circle = error.args[1][::-1]
        place = ("checks", list(visibility).index(circle[0]), "requires")
        text = f"never judged, because it requires itself: {' -> '.join(circle)}"
        yield source.problem(place, text)


def _points(source: Source, assignment: Assignment) -> Iterator[Problem]:
    points = math.fsum(spec.points for spec in assignment.checks)
    if points == 0.0:
        yield source.problem(("checks",), "the points of all checks add up to 0")
    if assignment.points is not None and not math.isclose(points, assignment.points):
        text = f"the points of all checks add up to {points:g}, not to {assignment.points:g}"
        yield source.problem(("points",), text)


def _check(assignment: Assignment, check: BoundCheck) -> Mistakes:
    judged = assignment.judged_by(check.spec)
    yield from _scenarios_of_check(assignment, check, judged)
    yield from _robots(check, judged)
    yield from _needs(assignment, check, judged)
    yield from _unknown_values(check, judged)
    for scenario in judged:
        if check.spec.from_ >= scenario.timeout:
            limit = format_duration(scenario.timeout)
            yield ("from",), f"the scenario {scenario.id!r} ends after {limit} at the latest"


def _scenarios_of_check(
    assignment: Assignment, check: BoundCheck, judged: Sequence[Scenario]
) -> Mistakes:
    name, spec = check.check.name, check.spec
    ids = [scenario.id for scenario in assignment.scenarios]
    if check.check.subject is Subject.SUBMISSION:
        if spec.scenarios or spec.window is not None:
            key = "scenarios" if spec.scenarios else "from, to, after, before and while"
            text = f"{name!r} judges what was handed in, not a run: leave {key!r} out"
            yield ("scenarios",), text
        return
    if not ids:
        yield (), f"{name!r} judges a run, but the assignment has no scenarios"
        return
    for number, scenario in enumerate(spec.scenarios):
        if scenario not in ids:
            advice = nearest_or_all(scenario, ids, "The scenarios are")
            yield ("scenarios", number), f"there is no scenario {scenario!r}.{advice}"
    if not spec.scenarios:
        yield from _other_programs(judged)


def _robots(check: BoundCheck, judged: Sequence[Scenario]) -> Mistakes:
    """A robot that a scenario does not have."""
    robot = check.spec.robot
    for scenario in judged:
        if robot is not None and robot not in scenario.robots:
            advice = nearest_or_all(robot, scenario.robots, "Its 'robots' are")
            yield ("robot",), f"the scenario {scenario.id!r} has no robot {robot!r}.{advice}"


def _needs(assignment: Assignment, check: BoundCheck, judged: Sequence[Scenario]) -> Mistakes:
    """What a check, and what its windows look at, need and lack."""
    bags = [scenario.id for scenario in judged if scenario.bag is not None]
    is_of_bag = bool(bags) and check.check.subject is Subject.RECORDING
    if is_of_bag and not check.parameters.judges_bags:
        text = (
            f"{check.check.name!r} looks at more than a bag holds, and the scenario {bags[0]!r} is "
            "a bag: messages with their times, their publishers, and the motion of the robot by "
            "its odometry"
        )
        yield ("uses",), text
    else:
        yield from unmet_needs(assignment, check, judged)
    phases = check.spec.window.phases if check.spec.window else {}
    for key, phase in phases.items():
        if is_of_bag and not phase.judges_bags:
            yield (key,), f"the scenario {bags[0]!r} is a bag, which does not show this"
            continue
        for place, text in unmet_needs(assignment, replace(check, parameters=phase), judged):
            yield (key, *place[1:]), text


def _unknown_values(check: BoundCheck, judged: Sequence[Scenario]) -> Mistakes:
    """Names in parameters for which a scenario that the check judges has no value."""
    for key, goal in check.parameters:
        if not isinstance(goal, Goal):
            continue
        for scenario in judged:
            known = {**scenario.values, **scenario.random}
            for name in goal.names:
                if name not in known:
                    advice = nearest_or_all(name, known, "It has")
                    text = f"the scenario {scenario.id!r} has no value {name!r}.{advice}"
                    yield ("with", key), text


def _other_programs(scenarios: Sequence[Scenario]) -> Mistakes:
    """Checks without ``scenarios`` where the scenarios launch different programs."""
    launched = [sorted(map(_program, scenario.launch)) for scenario in scenarios]
    for scenario, programs in zip(scenarios, launched, strict=True):
        if programs != launched[0]:
            text = (
                "name the 'scenarios' that it judges: they launch different programs: "
                f"{scenarios[0].id!r} launches {', '.join(launched[0])}, but {scenario.id!r} "
                f"{', '.join(programs)}"
            )
            yield (), text
            return


def _program(launch: Launch) -> str:
    """A launched program with the rules that give its nodes and topics other names."""
    renamed = [*launch.remap.items(), ("__node", launch.name), ("__ns", launch.namespace)]
    rules = ", ".join(f"{old}:={new}" for old, new in renamed if new is not None)
    return f"'{launch.program}'" + (f" ({rules})" if rules else "")
