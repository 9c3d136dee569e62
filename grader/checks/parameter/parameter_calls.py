"""Parameters of a node, as its parameter services told the probe.

What the services answer is kept in the recording call by call; here it is read. Numbers of
types are those of rcl_interfaces/msg/ParameterType.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grader.recording.model import Call, Recording

TYPES = {
    1: "bool",
    2: "integer",
    3: "double",
    4: "string",
    5: "byte_array",
    6: "bool_array",
    7: "integer_array",
    8: "double_array",
    9: "string_array",
}
_FIELDS = {
    1: "bool_value",
    2: "integer_value",
    3: "double_value",
    4: "string_value",
    5: "byte_array_value",
    6: "bool_array_value",
    7: "integer_array_value",
    8: "double_array_value",
    9: "string_array_value",
}
# Every node has these by itself; they say nothing of what the student wrote.
_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides.")


@dataclass(frozen=True)
class Range:
    """Values that a number may have, both ends included.

    Attributes:
        step: Between two values, 0 for any.
    """

    low: float
    high: float
    step: float


@dataclass(frozen=True)
class Descriptor:
    """How a parameter is declared.

    Attributes:
        type: As in :data:`TYPES`, or ``not set``.
        range: Allowed values, or None.
    """

    name: str
    type: str
    read_only: bool
    range: Range | None
    description: str


@dataclass(frozen=True)
class Reading:
    """A value at a time.

    Attributes:
        value: It, or None where it is not set.
    """

    call: Call
    value: Any


@dataclass(frozen=True)
class Setting:
    """An attempt to set a parameter.

    Attributes:
        accepted: Whether the node set it; None without an answer.
    """

    call: Call
    value: Any
    accepted: bool | None
    reason: str


def calls_to(recording: Recording, node: str, service: str) -> tuple[Call, ...]:
    """Calls with a request to one of a node's parameter services, in order."""
    name = f"{node}/{service}"
    return tuple(call for call in recording.calls if call.service == name and call.request)


def names(recording: Recording, node: str) -> list[str] | None:
    """Names of the parameters that the student declared, or None if nobody could tell."""
    for call in reversed(recording.calls):
        if call.service == f"{node}/list_parameters" and call.response is not None:
            listed = _mapping(call.response.get("result")).get("names")
            return [name for name in _items(listed) if not str(name).startswith(_OWN)]
    return None


def descriptor(recording: Recording, node: str, name: str) -> Descriptor | None:
    """How a parameter is declared, by the first answer; None if there is none.

    An undeclared parameter has a descriptor without type.
    """
    for call in calls_to(recording, node, "describe_parameters"):
        for item in _items(_mapping(call.response).get("descriptors")):
            found = _mapping(item)
            if found.get("name") == name:
                return Descriptor(
                    name=name,
                    type=TYPES.get(_whole(found.get("type")), "not set"),
                    read_only=found.get("read_only") is True,
                    range=_range(found),
                    description=str(found.get("description", "")),
                )
    return None


def readings(recording: Recording, node: str, name: str) -> tuple[Reading, ...]:
    """What a parameter's value was, each time that the probe asked for it."""
    return tuple(
        Reading(call, value_of(_mapping(value)))
        for call in calls_to(recording, node, "get_parameters")
        for asked, value in zip(
            _items(_mapping(call.request).get("names")),
            _items(_mapping(call.response).get("values")),
            strict=False,
        )
        if asked == name
    )


def settings(recording: Recording, node: str, name: str) -> tuple[Setting, ...]:
    """Every attempt to set a parameter."""
    return tuple(
        setting
        for call in calls_to(recording, node, "set_parameters")
        for setting in _settings(call, name)
    )


def _settings(call: Call, name: str) -> Iterator[Setting]:
    wanted = _items(_mapping(call.request).get("parameters"))
    results = _items(_mapping(call.response).get("results"))
    for number, item in enumerate(wanted):
        found = _mapping(item)
        if found.get("name") != name:
            continue
        value = value_of(_mapping(found.get("value")))
        if number >= len(results):
            yield Setting(call, value, None, "")
            continue
        result = _mapping(results[number])
        yield Setting(call, value, result.get("successful") is True, str(result.get("reason", "")))


def value_of(value: Mapping[str, Any]) -> Any:
    """The value in an rcl_interfaces/msg/ParameterValue, or None where it is not set."""
    return value.get(_FIELDS.get(_whole(value.get("type")), ""))


def _range(found: Mapping[str, Any]) -> Range | None:
    for key in ("floating_point_range", "integer_range"):
        for item in _items(found.get(key)):
            bounds = _mapping(item)
            ends = [bounds.get(end) for end in ("from_value", "to_value", "step")]
            numbers = [float(end) for end in ends if isinstance(end, int | float)]
            if len(numbers) == 3:
                return Range(*numbers)
    return None


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _items(value: Any) -> Sequence[Any]:
    return value if isinstance(value, list | tuple) else ()


def _whole(value: Any) -> int:
    return value if isinstance(value, int) else 0
