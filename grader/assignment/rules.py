"""What must fit together in an assignment, beyond the form of each value. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from graphlib import CycleError, TopologicalSorter

from grader.assignment.binding import BoundCheck
from grader.assignment.model import SHOWN_FROM, Assignment, CheckSpec, Launch, Scenario
from grader.assignment.needs import need_problems, no_executable, no_package
from grader.checks.check import Subject
from grader.errors import Problem
from grader.spec.document import Place
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Source


def problems(
    source: Source, assignment: Assignment, bound: Sequence[BoundCheck | None]
) -> Iterator[Problem]:
    """Find everything that does not fit together."""
    for key, name in (("packages", "name"), ("scenarios", "id"), ("checks", "id")):
        yield from source.duplicates(name, key)
    for index, scenario in enumerate(assignment.scenarios):
        for place, text in _scenario(assignment, scenario):
            yield source.problem(("scenarios", index, *place), text)
    yield from _requirements(source, assignment.checks)
    yield from _points(source, assignment)
    for index, check in enumerate(bound):
        for place, text in _check(assignment, check) if check is not None else ():
            yield source.problem(("checks", index, *place), text)


def _scenario(assignment: Assignment, scenario: Scenario) -> Iterator[tuple[Place, str]]:
    for number, launch in enumerate(scenario.launch):
        for place, text in _launch(assignment, launch):
            yield ("launch", number, *place), text
    topics = [recorded.topic for recorded in scenario.record]
    for number, topic in enumerate(topics):
        if topic in topics[:number]:
            yield ("record", number, "topic"), f"{topic!r} is recorded twice"
    until = scenario.until
    for key in ("messages", "quiet"):
        if not topics and getattr(until, key) is not None:
            yield ("until", key), "no topic is recorded: 'record' is missing"
    if scenario.world is None:
        for key in ("robot", "lidar", "odometry", "topics"):
            if key in scenario.model_fields_set:
                yield (key,), "there is a simulated robot only in a 'world', which is missing"
        for key in ("at_rest", "travelled"):
            if any(getattr(one, key) is not None for one in (until, *until.any)):
                text = f"{key!r} is about the simulated robot: 'world' is missing"
                yield ("until",), text


def _launch(assignment: Assignment, launch: Launch) -> Iterator[tuple[Place, str]]:
    # Of a name that stands twice the first counts.
    packages = {package.name: package for package in reversed(assignment.packages)}
    if launch.package is None and len(packages) != 1:
        listed = ", ".join(one.name for one in assignment.packages)
        yield (), f"the key 'package' is missing: there is not exactly one package ({listed})"
        return
    package = packages.get(launch.package or assignment.packages[0].name)
    if package is None:
        yield ("package",), no_package(str(launch.package), packages)
    elif launch.executable is not None and launch.executable not in package.executables:
        yield ("executable",), no_executable(launch.executable, package)


def _requirements(source: Source, checks: Sequence[CheckSpec]) -> Iterator[Problem]:
    shown = {spec.id: spec.visibility for spec in checks}
    for index, spec in enumerate(checks):
        for number, required in enumerate(spec.requires):
            place: Place = ("checks", index, "requires", number)
            if required not in shown:
                advice = nearest_or_all(required, shown, "The checks are")
                yield source.problem(place, f"there is no check {required!r}.{advice}")
            # A skip could not be told otherwise.
            elif SHOWN_FROM.index(shown[required]) > SHOWN_FROM.index(spec.visibility):
                text = (
                    f"{required!r} is {shown[required].value!r}, so {spec.id!r} cannot be "
                    f"{spec.visibility.value!r}: a student would lose its points for a reason that "
                    "is not shown"
                )
                yield source.problem(place, text)
    try:
        TopologicalSorter({spec.id: spec.requires for spec in checks}).prepare()
    except CycleError as error:
        circle = error.args[1][::-1]
        place = ("checks", list(shown).index(circle[0]), "requires")
        text = f"never judged, because it requires itself: {' -> '.join(circle)}"
        yield source.problem(place, text)


def _points(source: Source, assignment: Assignment) -> Iterator[Problem]:
    found, stated = math.fsum(spec.points for spec in assignment.checks), assignment.points
    if found == 0.0:
        yield source.problem(("checks",), "the points of all checks add up to 0")
    if stated is not None and not math.isclose(found, stated):
        text = f"the points of all checks add up to {found:g}, not to {stated:g}"
        yield source.problem(("points",), text)


def _check(assignment: Assignment, bound: BoundCheck) -> Iterator[tuple[Place, str]]:
    name, spec = bound.check.name, bound.spec
    scenarios = {scenario.id: scenario for scenario in assignment.scenarios}
    judged = [scenarios[one] for one in spec.scenarios or scenarios if one in scenarios]
    if bound.check.subject is Subject.SUBMISSION:
        if spec.scenarios:
            text = f"{name!r} judges what was handed in, not a run: leave 'scenarios' out"
            yield ("scenarios",), text
    elif not scenarios:
        yield (), f"{name!r} judges a run, but the assignment has no scenarios"
    else:
        for number, scenario in enumerate(spec.scenarios):
            if scenario not in scenarios:
                advice = nearest_or_all(scenario, scenarios, "The scenarios are")
                yield ("scenarios", number), f"there is no scenario {scenario!r}.{advice}"
        if not spec.scenarios:
            yield from _unnamed(judged)
    yield from need_problems(assignment, bound, judged)


def _unnamed(scenarios: Sequence[Scenario]) -> Iterator[tuple[Place, str]]:
    """A check of all scenarios would judge one program in the runs of another, too."""
    launched = [sorted(map(_program, scenario.launch)) for scenario in scenarios]
    for scenario, programs in zip(scenarios, launched, strict=True):
        if programs != launched[0]:
            text = (
                "name the 'scenarios' that it judges, for they do not launch the same: "
                f"{scenarios[0].id!r} launches {', '.join(launched[0])}, but {scenario.id!r} "
                f"{', '.join(programs)}"
            )
            yield (), text
            return


def _program(launch: Launch) -> str:
    """What is launched, with everything that gives its nodes and topics other names."""
    renamed = [*launch.remap.items(), ("__node", launch.name), ("__ns", launch.namespace)]
    rules = ", ".join(f"{old}:={new}" for old, new in renamed if new is not None)
    return f"'{launch.program}'" + (f" ({rules})" if rules else "")
