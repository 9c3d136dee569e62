"""What must fit together in an assignment, beyond the form of each value. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from grader.assignment.binding import BoundCheck
from grader.assignment.draft import Draft
from grader.assignment.model import Launch, Scenario
from grader.assignment.needs import need_problems, no_executable, no_package
from grader.assignment.withheld import SHOWN_FROM
from grader.checks.check import Subject
from grader.errors import Problem
from grader.spec.document import Place
from grader.spec.nearest_name import did_you_mean
from grader.spec.unit import format_duration


def problems(draft: Draft, bound: Sequence[BoundCheck | None]) -> Iterator[Problem]:
    """Find everything that does not fit together.

    Args:
        bound: One per entry of ``checks``; None where it could not be bound.
    """
    yield from _duplicates(draft, "packages", "name")
    yield from _duplicates(draft, "scenarios", "id")
    yield from _duplicates(draft, "checks", "id")
    for index, scenario in enumerate(draft.scenarios):
        if scenario is not None:
            yield from _scenario(draft, index, scenario)
    yield from _requirements(draft)
    yield from _circles(draft)
    yield from _points(draft)
    for index, check in enumerate(bound):
        if check is not None:
            yield from _check(draft, index, check)


def _duplicates(draft: Draft, key: str, name: str) -> Iterator[Problem]:
    seen: dict[str, Place] = {}
    for index, value in enumerate(draft.names(key, name)):
        place = (key, index, name)
        if value in seen:
            line = draft.source.line(seen[value])
            yield draft.source.problem(place, f"{value!r} stands twice (first in line {line})")
        elif value is not None:
            seen[value] = place


def _scenario(draft: Draft, index: int, scenario: Scenario) -> Iterator[Problem]:
    place: Place = ("scenarios", index)
    problem = draft.source.problem
    for number, launch in enumerate(scenario.launch):
        yield from _launch(draft, (*place, "launch", number), launch)
    topics = [recorded.topic for recorded in scenario.record]
    for number, topic in enumerate(topics):
        if topic in topics[:number]:
            yield problem((*place, "record", number, "topic"), f"{topic!r} is recorded twice")
    until = scenario.until
    if not topics:
        for key in ("messages", "quiet"):
            if getattr(until, key) is not None:
                yield problem((*place, "until", key), "no topic is recorded: 'record' is missing")
    if scenario.world is None:
        for key in ("robot", "lidar", "odometry", "topics"):
            if key in scenario.model_fields_set:
                text = "there is a simulated robot only in a 'world', which is missing"
                yield problem((*place, key), text)
        for key in ("at_rest", "travelled"):
            if any(getattr(one, key) is not None for one in (until, *until.any)):
                text = f"{key!r} is about the simulated robot: 'world' is missing"
                yield problem((*place, "until"), text)
    for key, limit in (("quiet", until.quiet), ("elapsed", until.elapsed)):
        if limit is not None and limit >= scenario.timeout:
            shown, timeout = format_duration(limit), format_duration(scenario.timeout)
            yield problem(
                (*place, "until", key),
                f"{shown} can never pass before the timeout of {timeout} ends the scenario",
            )


def _launch(draft: Draft, place: Place, launch: Launch) -> Iterator[Problem]:
    names = [name for name in draft.names("packages", "name") if name is not None]
    if launch.package is None and len(names) != 1:
        listed = ", ".join(names) or "none"
        text = f"the key 'package' is missing: there is not exactly one package ({listed})"
        yield draft.source.problem(place, text)
        return
    package = draft.package(launch.package or names[0])
    if launch.package is not None and launch.package not in names:
        yield draft.source.problem((*place, "package"), no_package(launch.package, names))
    elif package is None or launch.executable is None:
        return
    elif launch.executable not in package.executables:
        yield draft.source.problem(
            (*place, "executable"), no_executable(launch.executable, package)
        )


def _requirements(draft: Draft) -> Iterator[Problem]:
    names = draft.names("checks")
    known = [name for name in names if name is not None]
    for index, spec in enumerate(draft.checks):
        for number, required in enumerate(spec.requires if spec else ()):
            place = ("checks", index, "requires", number)
            if required == names[index]:
                yield draft.source.problem(place, "a check cannot require itself")
            elif required not in known:
                listed = f" The checks are: {', '.join(known)}."
                advice = did_you_mean(required, known) or listed
                yield draft.source.problem(place, f"there is no check {required!r}.{advice}")
    yield from _shown_too_late(draft)


def _shown_too_late(draft: Draft) -> Iterator[Problem]:
    """What a check waits for is shown no later than the check, or a skip could not be told."""
    shown = {spec.id: spec.visibility for spec in draft.checks if spec is not None}
    for index, spec in enumerate(draft.checks):
        for number, required in enumerate(spec.requires if spec else ()):
            if spec is None or required not in shown:
                continue
            mine, other = spec.visibility, shown[required]
            if SHOWN_FROM.index(other) > SHOWN_FROM.index(mine):
                text = (
                    f"{required!r} is {other.value!r}, so {spec.id!r} cannot be {mine.value!r}: "
                    "a student would lose its points for a reason that is not shown"
                )
                yield draft.source.problem(("checks", index, "requires", number), text)


def _circles(draft: Draft) -> Iterator[Problem]:
    requires = {
        spec.id: {other for other in spec.requires if other != spec.id}
        for spec in draft.checks
        if spec is not None
    }
    waiting = {check: others & requires.keys() for check, others in requires.items()}
    while waiting:
        ready = [check for check, others in waiting.items() if not others & waiting.keys()]
        if not ready:
            circle = _circle(waiting)
            place = ("checks", draft.names("checks").index(circle[0]), "requires")
            text = f"never judged, because it requires itself: {' -> '.join(circle)}"
            yield draft.source.problem(place, text)
            ready = circle
        waiting = {check: others for check, others in waiting.items() if check not in ready}


def _circle(waiting: dict[str, set[str]]) -> list[str]:
    path = [next(iter(waiting))]
    while path.count(path[-1]) == 1:
        path.append(min(waiting[path[-1]] & waiting.keys()))
    circle = path[path.index(path[-1]) : -1]
    # Told from the check that the author wrote first.
    first = min(circle, key=list(waiting).index)
    at = circle.index(first)
    return [*circle[at:], *circle[:at], first]


def _points(draft: Draft) -> Iterator[Problem]:
    if draft.checks and all(spec is not None and spec.points == 0.0 for spec in draft.checks):
        yield draft.source.problem(("checks",), "the points of all checks add up to 0")
    stated = draft.source.data.get("points")
    if isinstance(stated, bool) or not isinstance(stated, int | float):
        return
    if all(spec is not None for spec in draft.checks):
        # The small amount is float noise of the sum.
        found = sum(spec.points for spec in draft.checks if spec is not None)
        if abs(found - stated) > 1e-9:
            text = f"the points of all checks add up to {found:g}, not to {stated:g}"
            yield draft.source.problem(("points",), text)


def _check(draft: Draft, index: int, bound: BoundCheck) -> Iterator[Problem]:
    place: Place = ("checks", index)
    problem = draft.source.problem
    name, spec = bound.check.name, bound.spec
    known = [one for one in draft.names("scenarios") if one is not None]
    if bound.check.subject is Subject.SUBMISSION:
        if spec.scenarios:
            text = f"{name!r} judges what was handed in, not a run: leave 'scenarios' out"
            yield problem((*place, "scenarios"), text)
    elif not draft.scenarios:
        yield problem(place, f"{name!r} judges a run, but the assignment has no scenarios")
    else:
        for number, scenario in enumerate(spec.scenarios):
            if scenario not in known:
                advice = did_you_mean(scenario, known)
                text = f"there is no scenario {scenario!r}."
                listed = f" The scenarios are: {', '.join(known)}."
                yield problem((*place, "scenarios", number), text + (advice or listed))
        yield from _unnamed(draft, place, bound)
    yield from need_problems(draft, place, bound)


def _unnamed(draft: Draft, place: Place, bound: BoundCheck) -> Iterator[Problem]:
    """A check of all scenarios would judge one program in the runs of another, too."""
    if bound.spec.scenarios:
        return
    launched = {
        scenario.id: sorted(map(_program, scenario.launch))
        for scenario in draft.scenarios_of(bound.spec) or ()
    }
    first = next(iter(launched), None)
    for scenario, programs in launched.items():
        if first is not None and programs != launched[first]:
            text = (
                f"name the 'scenarios' that it judges, for they do not launch the same: {first!r} "
                f"launches {', '.join(launched[first])}, but {scenario!r} {', '.join(programs)}"
            )
            yield draft.source.problem(place, text)
            return


def _program(launch: Launch) -> str:
    """What is launched, with everything that gives its nodes and topics other names."""
    renamed = [*launch.remap.items(), ("__node", launch.name), ("__ns", launch.namespace)]
    rules = ", ".join(f"{old}:={new}" for old, new in renamed if new is not None)
    return f"'{launch.program}'" + (f" ({rules})" if rules else "")
