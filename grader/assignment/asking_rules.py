"""What checks of services, actions, parameters and source need of an assignment. Pure but for ruff.

A check of what was asked needs a stimulus that asks, in each of its scenarios; without one it
would end as an error for everybody.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from grader.assignment.asking import CallService, ReadParameters, SendGoal, SetParameters
from grader.assignment.binding import BoundCheck
from grader.assignment.draft import Draft
from grader.assignment.model import Scenario
from grader.checks.action.action import OfGoals, Result
from grader.checks.action.action_end import Cancels, Preempts
from grader.checks.lifecycle.lifecycle import State
from grader.checks.parameter.parameter import Declared, OfParameter, same_value
from grader.checks.service.service import Concurrent, Responds
from grader.checks.source.source import Ruff
from grader.errors import GraderFault, Problem
from grader.spec.document import Place
from grader.spec.nearest_name import did_you_mean
from grader.spec.unit import format_duration
from grader.submission.read.lint import find_ruff, known_rules

_GET_STATE = "/get_state"


def asking_problems(draft: Draft, place: Place, bound: BoundCheck) -> Iterator[Problem]:
    """Find what a check lacks.

    Args:
        draft: The document, as far as it could be read.
        place: Of the check.
        bound: The check.
    """
    parameters = bound.parameters
    if isinstance(parameters, Ruff):
        yield from _rules(draft, (*place, "with", "rules"), parameters)
    for scenario in draft.scenarios_of(bound.spec) or ():
        for key, text in _lacks(scenario, parameters):
            yield draft.source.problem((*place, "with", key), text)


def _lacks(scenario: Scenario, parameters: object) -> Iterator[tuple[str, str]]:
    """Keys of the check with what the scenario lacks for them."""
    if isinstance(parameters, Responds | Concurrent):
        calls = [one for one in scenario.stimuli if isinstance(one, CallService)]
        yield from _named(scenario, "service", parameters.service, [one.call for one in calls])
        mine = [one for one in calls if one.call == parameters.service]
        if isinstance(parameters, Concurrent) and mine and all(one.at_once < 2 for one in mine):
            text = f"the scenario {scenario.id!r} calls it never twice at once: 'at_once: 2'"
            yield "service", text
        if isinstance(parameters, Responds):
            waits = [one.within for one in mine if _meant(parameters.request, one.sequence)]
            yield from _patient(scenario, parameters.within, waits)
    elif isinstance(parameters, OfGoals):
        goals = [one for one in scenario.stimuli if isinstance(one, SendGoal)]
        yield from _named(scenario, "action", parameters.action, [one.send_goal for one in goals])
        mine_ = [one for one in goals if one.send_goal == parameters.action]
        yield from _ends(scenario, parameters, mine_)
        if isinstance(parameters, Result):
            waits = [one.within for one in mine_ if _meant(parameters.goal, [one.goal])]
            yield from _patient(scenario, parameters.within, waits)
    elif isinstance(parameters, OfParameter):
        yield from _parameter(scenario, parameters)
    elif isinstance(parameters, State):
        called = [one.call for one in scenario.stimuli if isinstance(one, CallService)]
        service = parameters.node + _GET_STATE
        yield from _named(scenario, "node", service, called)
        asked = sum(
            len(one.sequence)
            for one in scenario.stimuli
            if isinstance(one, CallService) and one.call == service
        )
        if 0 < asked < len(parameters.states):
            text = f"the scenario {scenario.id!r} calls {service!r} only {asked} times"
            yield "states", text


def _named(
    scenario: Scenario, key: str, wanted: str, there: list[str]
) -> Iterator[tuple[str, str]]:
    if wanted not in there:
        advice = did_you_mean(wanted, there) or f" There are: {', '.join(there) or 'none'}."
        yield key, f"no stimulus of the scenario {scenario.id!r} asks {wanted!r}.{advice}"


def _patient(
    scenario: Scenario, within_s: float, waits_s: Iterable[float]
) -> Iterator[tuple[str, str]]:
    """The stimulus must wait for as long as the check allows."""
    short_s = min(waits_s, default=within_s)
    if short_s < within_s:
        short, needed = format_duration(short_s), format_duration(within_s)
        text = f"a stimulus of the scenario {scenario.id!r} waits only {short} for an answer"
        yield "within", f"{text}: give it 'within: {needed}' too"


def _meant(wanted: Mapping[str, Any], given: Sequence[Mapping[str, Any]]) -> bool:
    """Whether one of some requests has the fields that a check asks for, as both are written."""
    return any(all(fields.get(key) == item for key, item in wanted.items()) for fields in given)


def _ends(
    scenario: Scenario, parameters: OfGoals, goals: list[SendGoal]
) -> Iterator[tuple[str, str]]:
    needed: list[tuple[type[OfGoals], str, Callable[[SendGoal], bool]]] = [
        (Cancels, "cancel_after", lambda goal: goal.cancel_after is not None),
        (Preempts, "preempt", lambda goal: goal.preempt),
    ]
    for kind, key, has in needed:
        if isinstance(parameters, kind) and goals and not any(map(has, goals)):
            text = f"no goal of the scenario {scenario.id!r} has {key!r}"
            yield "action", text


def _parameter(scenario: Scenario, parameters: OfParameter) -> Iterator[tuple[str, str]]:
    settings = [one for one in scenario.stimuli if isinstance(one, SetParameters)]
    reading = [one for one in scenario.stimuli if isinstance(one, ReadParameters)]
    nodes = [one.node for one in settings]
    if isinstance(parameters, Declared):
        nodes += [one.read_parameters for one in reading]
    yield from _named(scenario, "node", parameters.node, nodes)
    if isinstance(parameters, Declared) or parameters.node not in nodes:
        return
    tried = [
        one.set_parameters[parameters.name]
        for one in settings
        if one.node == parameters.node and parameters.name in one.set_parameters
    ]
    wanted = getattr(parameters, "value", None)
    drawn = any(isinstance(value, str) for value in tried)
    if not drawn and not any(same_value(wanted, value) for value in tried):
        listed = ", ".join(map(repr, tried)) or "nothing"
        yield (
            "value",
            (
                f"the scenario {scenario.id!r} sets {parameters.name!r} to {listed}, never to "
                f"{wanted!r}"
            ),
        )


def _rules(draft: Draft, place: Place, parameters: Ruff) -> Iterator[Problem]:
    """Rules that ruff does not have are never broken, and would give points to everybody."""
    ruff = find_ruff()
    if ruff is None:
        return
    try:
        known = known_rules(ruff)
    except GraderFault:
        return
    for index, rule in enumerate(parameters.rules):
        if not any(code.startswith(rule) for code in known):
            text = f"ruff has no rule {rule!r}." + did_you_mean(rule, known)
            yield draft.source.problem((*place, index), text)
