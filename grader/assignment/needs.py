"""Whether an assignment has what its checks need, as each check declares it. Pure but for ruff.

A check without it would end as an error, or as a failure, for every student.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

from grader.assignment.binding import BoundCheck
from grader.assignment.draft import Draft
from grader.assignment.model import Package, Scenario
from grader.assignment.stimuli.kinds.join import Join
from grader.assignment.stimuli.kinds.publish import Publish
from grader.assignment.stimuli.kinds.request import (
    CallService,
    ReadParameters,
    SendGoal,
    SetParameters,
)
from grader.checks.need import (
    Called,
    GoalSent,
    Joined,
    Need,
    ParameterSet,
    ParametersRead,
    Published,
    Recorded,
    RuffRules,
    SimulatedRobot,
    Submitted,
)
from grader.checks.value import same_value
from grader.errors import GraderFault, Problem
from grader.spec.document import Place
from grader.spec.nearest_name import did_you_mean
from grader.spec.unit import format_duration
from grader.submission.read.lint import find_ruff, known_rules

_Lack = tuple[Place, str]
"""A place below the entry of a check, and what is wrong there."""


@dataclass(frozen=True)
class _User:
    """A check with what its needs are looked for in."""

    bound: BoundCheck
    draft: Draft
    scenarios: Sequence[Scenario]

    def value(self, key: str | None) -> Any:
        return getattr(self.bound.parameters, key) if key else None


def need_problems(draft: Draft, place: Place, bound: BoundCheck) -> Iterator[Problem]:
    """Find what a check needs and the assignment lacks."""
    user = _User(bound, draft, draft.scenarios_of(bound.spec) or ())
    for need in bound.parameters.needs:
        for key, text in _lacks(need, user):
            yield draft.source.problem((*place, *key), text)


@singledispatch
def _lacks(need: Need, user: _User) -> Iterator[_Lack]:
    raise NotImplementedError(type(need))


@_lacks.register
def _(need: SimulatedRobot, user: _User) -> Iterator[_Lack]:
    for scenario in user.scenarios:
        if scenario.world is None:
            text = f"the scenario {scenario.id!r} has no 'world', and so no simulated robot"
            yield ("uses",), text


@_lacks.register
def _(need: Recorded, user: _User) -> Iterator[_Lack]:
    topic, interface = user.value(need.topic), user.value(need.type)
    if user.value(need.kind) == "subscription":
        return
    for scenario in user.scenarios:
        recorded = scenario.recorded_types
        if topic not in recorded:
            listed = f" It records: {', '.join(recorded) or 'nothing'}."
            text = f"the scenario {scenario.id!r} does not record {topic!r}."
            yield ("with", need.topic), text + (did_you_mean(topic, recorded) or listed)
        elif interface not in (None, recorded[topic]):
            text = f"the scenario {scenario.id!r} records {topic!r} as {recorded[topic]!r}"
            yield ("with", "type"), text


@_lacks.register
def _(need: Published, user: _User) -> Iterator[_Lack]:
    for scenario in user.scenarios:
        topics = [one.publish for one in scenario.stimuli if isinstance(one, Publish)]
        yield from _unnamed(user, scenario, need.topic, topics, "do not publish on")


@_lacks.register
def _(need: Joined, user: _User) -> Iterator[_Lack]:
    for scenario in user.scenarios:
        names = [one.name for one in scenario.stimuli if isinstance(one, Join)]
        yield from _unnamed(user, scenario, need.name, names, "do not have a join")


def _unnamed(
    user: _User, scenario: Scenario, key: str, names: Sequence[str], lack: str
) -> Iterator[_Lack]:
    wanted = user.value(key)
    if wanted is not None and wanted not in names:
        text = f"the stimuli of the scenario {scenario.id!r} {lack} {wanted!r}."
        yield ("with", key), text + _advice(wanted, names)


def _advice(wanted: str, names: Sequence[str]) -> str:
    return did_you_mean(wanted, names) or f" There are: {', '.join(names) or 'none'}."


@_lacks.register
def _(need: Called, user: _User) -> Iterator[_Lack]:
    service = user.value(need.service) + need.suffix
    key = ("with", need.service)
    for scenario in user.scenarios:
        calls = [one for one in scenario.stimuli if isinstance(one, CallService)]
        yield from _unasked(scenario, key, service, [one.call for one in calls])
        mine = [one for one in calls if one.call == service]
        if mine and all(one.at_once < need.at_once for one in mine):
            text = f"the scenario {scenario.id!r} calls it never twice at once: 'at_once: 2'"
            yield key, text
        asked = sum(len(one.sequence) for one in mine)
        if need.count is not None and 0 < asked < len(user.value(need.count)):
            text = f"the scenario {scenario.id!r} calls {service!r} only {asked} times"
            yield ("with", need.count), text
        fields = user.value(need.request) or {}
        waits_s = [one.within for one in mine if _has_fields(fields, one.sequence)]
        yield from _impatient(user, scenario, need.within, waits_s)


@_lacks.register
def _(need: GoalSent, user: _User) -> Iterator[_Lack]:
    action, key = user.value(need.action), ("with", need.action)
    for scenario in user.scenarios:
        goals = [one for one in scenario.stimuli if isinstance(one, SendGoal)]
        yield from _unasked(scenario, key, action, [one.send_goal for one in goals])
        mine = [one for one in goals if one.send_goal == action]
        if need.having is not None and mine and not any(getattr(g, need.having) for g in mine):
            yield key, f"no goal of the scenario {scenario.id!r} has {need.having!r}"
        fields = user.value(need.goal)
        waits_s = [one.within for one in mine if _has_fields(fields, [one.goal])]
        yield from _impatient(user, scenario, need.within, waits_s)


def _unasked(scenario: Scenario, key: Place, wanted: str, there: Sequence[str]) -> Iterator[_Lack]:
    if wanted not in there:
        text = f"no stimulus of the scenario {scenario.id!r} asks {wanted!r}."
        yield key, text + _advice(wanted, there)


def _has_fields(wanted: Mapping[str, Any], given: Sequence[Mapping[str, Any]]) -> bool:
    """Whether one of some requests has the fields that a check asks for, as both are written."""
    return any(all(fields.get(key) == item for key, item in wanted.items()) for fields in given)


def _impatient(
    user: _User, scenario: Scenario, key: str | None, waits_s: Iterable[float]
) -> Iterator[_Lack]:
    """A stimulus that waits for less time than the check allows."""
    if key is None:
        return
    within_s = user.value(key)
    short_s = min(waits_s, default=within_s)
    if short_s < within_s:
        short, needed = format_duration(short_s), format_duration(within_s)
        text = f"a stimulus of the scenario {scenario.id!r} waits only {short} for an answer"
        yield ("with", key), f"{text}: give it 'within: {needed}' too"


@_lacks.register
def _(need: ParametersRead, user: _User) -> Iterator[_Lack]:
    for scenario in user.scenarios:
        read = [one.read_parameters for one in scenario.stimuli if isinstance(one, ReadParameters)]
        nodes = [*_nodes_set(scenario), *read]
        yield from _unasked(scenario, ("with", need.node), user.value(need.node), nodes)


@_lacks.register
def _(need: ParameterSet, user: _User) -> Iterator[_Lack]:
    node, name, wanted = map(user.value, (need.node, need.name, need.value))
    for scenario in user.scenarios:
        nodes = _nodes_set(scenario)
        yield from _unasked(scenario, ("with", need.node), node, nodes)
        tried = [
            one.set_parameters[name]
            for one in scenario.stimuli
            if isinstance(one, SetParameters) and one.node == node and name in one.set_parameters
        ]
        drawn = any(isinstance(value, str) for value in tried)
        if node in nodes and not drawn and not any(same_value(wanted, value) for value in tried):
            listed = ", ".join(map(repr, tried)) or "nothing"
            text = f"the scenario {scenario.id!r} sets {name!r} to {listed}, never to {wanted!r}"
            yield ("with", need.value), text


def _nodes_set(scenario: Scenario) -> list[str]:
    return [one.node for one in scenario.stimuli if isinstance(one, SetParameters)]


@_lacks.register
def _(need: Submitted, user: _User) -> Iterator[_Lack]:
    name, executable = user.value(need.package), user.value(need.executable)
    names = [one for one in user.draft.names("packages", "name") if one is not None]
    package = user.draft.package(name)
    if name not in names:
        yield ("with", need.package), no_package(name, names)
    elif package and need.executable and executable not in package.executables:
        yield ("with", need.executable), no_executable(executable, package)


def no_package(name: str, names: Sequence[str]) -> str:
    """That no package of the assignment has a name."""
    listed = f" The packages are: {', '.join(names) or 'none'}."
    return f"{name!r} is not among 'packages'." + (did_you_mean(name, names) or listed)


def no_executable(name: str, package: Package) -> str:
    """That a package has no executable of a name."""
    listed = f" It has: {', '.join(package.executables) or 'none'}."
    advice = did_you_mean(name, package.executables) or listed
    return f"the package {package.name!r} has no executable {name!r} in 'packages'.{advice}"


@_lacks.register
def _(need: RuffRules, user: _User) -> Iterator[_Lack]:
    ruff = find_ruff()
    if ruff is None:
        return
    try:
        known = known_rules(ruff)
    except GraderFault:
        return
    for index, rule in enumerate(user.value(need.rules)):
        if not any(code.startswith(rule) for code in known):
            text = f"ruff has no rule {rule!r}." + did_you_mean(rule, known)
            yield ("with", need.rules, index), text
