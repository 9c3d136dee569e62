"""Requests, goals and parameter values of stimuli, from the YAML to plain values."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from grader.assignment.random_values import fill_in
from grader.assignment.stimuli.kinds.request import CallService, Request, SendGoal, SetParameters
from grader.assignment.stimuli.message import Find, MessageError, read_message
from grader.assignment.stimuli.stimulus_messages import StimulusError
from grader.errors import UsageError
from grader.spec.document import Place

SEPARATOR = re.compile(r"^---\s*$", re.MULTILINE)
_SCALARS = (bool, int, float, str)


def requests_of(
    call: CallService, find: Find, drawn: Mapping[str, float]
) -> tuple[dict[str, Any], ...]:
    """The requests of a call, in order.

    Raises:
        StimulusError: A value does not fit the request.
        KeyError: A definition is missing.
    """
    found = []
    for index, value in enumerate(call.sequence):
        place: Place = ("requests", index) if call.requests else ("request",)
        found.append(_part(value, call.type, find, drawn, place))
    return tuple(found)


def goal_of(goal: SendGoal, find: Find, drawn: Mapping[str, float]) -> dict[str, Any]:
    """The fields of a goal.

    Raises:
        StimulusError: A value does not fit the goal.
        KeyError: A definition is missing.
    """
    return _part(goal.goal, goal.type, find, drawn, ("goal",))


def values_of(settings: SetParameters, drawn: Mapping[str, float]) -> dict[str, Any]:
    """The values that parameters are set to.

    Raises:
        StimulusError: A value is none that a parameter can have.
    """
    return {
        name: _value(name, value, dict(drawn)) for name, value in settings.set_parameters.items()
    }


def mistakes(item: Request, find: Find, drawn: Mapping[str, float]) -> Iterator[tuple[Place, str]]:
    """What does not fit in a stimulus, as far as it can be told here."""
    folders = {CallService: "srv", SendGoal: "action"}
    folder = folders.get(type(item))
    if folder is not None and f"/{folder}/" not in getattr(item, "type", ""):
        yield ("type",), f"expected an interface in {folder}, such as package/{folder}/Name"
        return
    try:
        if isinstance(item, SetParameters):
            values_of(item, drawn)
        elif isinstance(item, CallService):
            requests_of(item, find, drawn)
        elif isinstance(item, SendGoal):
            goal_of(item, find, drawn)
    except StimulusError as error:
        yield error.place, str(error)
    except KeyError:
        # Of a package that is not installed here.
        return


def _part(
    value: Mapping[str, Any], interface: str, find: Find, drawn: Mapping[str, float], place: Place
) -> dict[str, Any]:
    """Read the first part of a definition: a request, or a goal."""

    def first(name: str) -> str:
        text = find(name)
        return SEPARATOR.split(text)[0] if name == interface else text

    try:
        return read_message(value, interface, first, drawn)
    except MessageError as error:
        raise StimulusError(str(error), (*place, *error.place)) from None


def _value(name: str, value: Any, drawn: dict[str, float]) -> Any:
    place: Place = ("set_parameters", name)
    try:
        found = fill_in(value, drawn)
    except UsageError as error:
        raise StimulusError(str(error), place) from None
    items = found if isinstance(found, list) else [found]
    kinds = {type(item) for item in items}
    if not items:
        raise StimulusError(f"{name}: an empty list has no type", place)
    if not kinds <= set(_SCALARS) or (len(kinds) > 1 and kinds != {int, float}):
        text = f"{name}: expected a truth, a number, a text, or a list of one kind of these"
        raise StimulusError(text, place)
    return found
