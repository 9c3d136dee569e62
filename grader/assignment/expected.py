"""Fields of messages that checks name, against the definitions of those messages.

What a message cannot have would end as an error, for everybody, once they have published one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

from grader.assignment.binding import BoundCheck
from grader.assignment.document import Place
from grader.assignment.interfaces import Interfaces
from grader.assignment.message import Find
from grader.assignment.model import Assignment, Scenario
from grader.assignment.source import Source
from grader.assignment.stimulus import Publish
from grader.checks import following, log
from grader.checks.field import value_at
from grader.checks.messages import Equal
from grader.checks.value import NoSuchField, expected_leaves
from grader.errors import Problem
from grader.recording.interface import TEXTS, fields_of

_INDEX = re.compile(r"\[\d+\]")


def problems(
    source: Source, assignment: Assignment, checks: Sequence[BoundCheck], known: Interfaces
) -> Iterator[Problem]:
    """Find fields that the messages do not have; where a definition is not at hand, none.

    Args:
        source: The document.
        assignment: What was read from it.
        checks: Its checks, in order.
        known: Definitions at hand.
    """
    for index, bound in enumerate(checks):
        parameters = bound.parameters
        if not isinstance(parameters, Equal | following.Follows | log.Follows):
            continue
        for interface in _types(assignment, bound, parameters.topic):
            try:
                message = _sample(interface, known.find)
            except KeyError:
                continue
            for place, lack in _lacks(parameters, message):
                text = f"{parameters.topic} ({interface}): {lack}"
                yield source.problem(("checks", index, "with", *place), text)


def _types(assignment: Assignment, bound: BoundCheck, topic: str) -> list[str]:
    """The types that a topic has in the scenarios of a check."""
    wanted = bound.spec.scenarios
    judged = [one for one in assignment.scenarios if not wanted or one.id in wanted]
    found = (_type(scenario, topic) for scenario in judged)
    return list(dict.fromkeys(interface for interface in found if interface is not None))


def _type(scenario: Scenario, topic: str) -> str | None:
    sent = {one.publish: one.type for one in scenario.stimuli if isinstance(one, Publish)}
    return {**sent, **scenario.recorded_types}.get(topic)


def _lacks(
    parameters: Equal | following.Follows | log.Follows, message: dict[str, Any]
) -> Iterator[tuple[Place, str]]:
    if isinstance(parameters, Equal):
        try:
            expected_leaves(parameters.value, message)
        except NoSuchField as error:
            yield ("value",), str(error)
        return
    for number, field in enumerate(parameters.fields):
        try:
            value_at(message, _INDEX.sub("[0]", field))
        except NoSuchField as error:
            inside = field if isinstance(parameters, following.Follows) else number
            yield ("fields", inside), str(error)


def _sample(interface: str, find: Find, around: tuple[str, ...] = ()) -> dict[str, Any]:
    """A message of a type, with one value in each of its arrays.

    Args:
        interface: The type.
        find: Finds definitions.
        around: Types that it stands in.

    Raises:
        KeyError: A definition is missing, or is of a message that holds itself, of which
            :mod:`grader.assignment.interfaces` tells.
    """
    if interface in around:
        raise KeyError(interface)
    found: dict[str, Any] = {}
    for name, field in fields_of(interface, find(interface)).items():
        plain: Any = "" if field.type in TEXTS else 0
        value = _sample(field.type, find, (*around, interface)) if field.is_message else plain
        found[name] = [value] if field.is_array else value
    return found
