"""Parameters of a node, as its parameter services (rcl_interfaces/srv) answered the probe."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, repeat
from typing import Any, Literal, get_args

from grader.recording.model import Call, Recording
from grader.spec.nearest_name import nearest

Type = Literal[
    "bool", "integer", "double", "string", "byte_array", "bool_array", "integer_array",
    "double_array", "string_array",
]  # fmt: skip
# Numbers of rcl_interfaces/msg/ParameterType.
_TYPES = dict(enumerate(get_args(Type), start=1))
_NO_RESULT = {"successful": False, "reason": "the node gave no result"}
# Every node has these by itself; they say nothing of what the student wrote.
_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides.")


@dataclass(frozen=True)
class Descriptor:
    """How a parameter is declared.

    Attributes:
        type: One of :data:`Type`, or ``not set``.
        range: Lowest and highest value, and the step between two values (0 for any); or None.
    """

    type: str
    read_only: bool
    range: tuple[float, float, float] | None
    description: str


@dataclass(frozen=True)
class Reading:
    """The value of a parameter when the probe asked for it; None where it is not set."""

    call: Call
    value: Any


@dataclass(frozen=True)
class Setting:
    """An attempt to set a parameter, and the node's answer."""

    call: Call
    value: Any
    accepted: bool
    reason: str


def calls_to(recording: Recording, node: str, *services: str) -> tuple[Call, ...]:
    """Calls with a request to some of a node's parameter services, in order."""
    names = [f"{node}/{service}" for service in services]
    return tuple(call for call in recording.calls if call.service in names and call.request)


def names(recording: Recording, node: str) -> list[str]:
    """Names of the parameters that the student declared, as the node listed them last."""
    for call in reversed(recording.calls):
        if call.service == f"{node}/list_parameters" and call.response is not None:
            listed = call.response["result"]["names"]
            return [name for name in listed if not name.startswith(_OWN)]
    return []


def undeclared(recording: Recording) -> list[str]:
    """Parameters that the launch gives and no node of the student declares.

    Nothing where a node did not answer, and in older recordings, where none was asked.
    """
    answered = {
        call.service.rpartition("/")[0]
        for call in recording.calls
        if call.service.endswith("/list_parameters") and call.response is not None
    }
    nodes = [node.name for node in recording.written_nodes]
    if not nodes or not answered.issuperset(nodes):
        return []
    declared = {name for node in nodes for name in names(recording, node)}
    given = (name for name in recording.given_parameters if not name.startswith(_OWN))
    return [name for name in given if name not in declared]


def misnamed_parameters(recording: Recording, asked: Collection[str]) -> dict[str, str]:
    """Undeclared parameter of the launch -> another that is declared and is probably meant by it.

    They have most words in common, or nearly the same letters; each is meant once.
    """
    declared = {name for node in recording.student_nodes for name in names(recording, node.name)}
    unused = sorted(declared - {*recording.given_parameters})
    likely = {}
    for name in undeclared(recording):
        meant = _meant(name, unused)
        if name in asked and meant is not None:
            likely[name] = meant
    meant_once = Counter(likely.values())
    return {name: meant for name, meant in likely.items() if meant_once[meant] == 1}


def _meant(name: str, others: Sequence[str]) -> str | None:
    """Which of some parameters has most words in common with a name, or nearly the same letters."""
    lower = {other.lower(): other for other in others}
    common = {other: len({*name.split("_")} & {*other.split("_")}) for other in lower}
    most = max(common.values(), default=0)
    best = [other for other in lower if common[other] == most > 0]
    likely = best[0] if len(best) == 1 else nearest(name, best or list(lower))
    return lower[likely] if likely else None


def descriptor(recording: Recording, node: str, name: str) -> Descriptor | None:
    """How a parameter is declared, by the first answer; None if there is none.

    An undeclared parameter has a descriptor without type.
    """
    for call in calls_to(recording, node, "describe_parameters"):
        for found in _answered(call, "descriptors"):
            if found["name"] == name:
                ranges = (*found["floating_point_range"], *found["integer_range"])
                return Descriptor(
                    _TYPES.get(found["type"], "not set"),
                    found["read_only"],
                    next(((r["from_value"], r["to_value"], r["step"]) for r in ranges), None),
                    found["description"],
                )
    return None


def readings(recording: Recording, node: str, name: str) -> tuple[Reading, ...]:
    """What a parameter's value was, each time that the probe asked for it."""
    found = []
    for call in calls_to(recording, node, "get_parameters"):
        asked = (call.request or {})["names"]
        for other, value in zip(asked, _answered(call, "values"), strict=False):
            if other == name:
                found.append(Reading(call, _value(value)))
    return tuple(found)


def settings(recording: Recording, node: str, name: str) -> tuple[Setting, ...]:
    """Every attempt to set a parameter."""
    found = []
    for call in calls_to(recording, node, "set_parameters"):
        asked = (call.request or {})["parameters"]
        results = chain(_answered(call, "results"), repeat(_NO_RESULT))
        for wanted, result in zip(asked, results, strict=False):
            if wanted["name"] == name:
                value, accepted = _value(wanted["value"]), result["successful"]
                found.append(Setting(call, value, accepted, result["reason"]))
    return tuple(found)


def _answered(call: Call, key: str) -> Sequence[Any]:
    return call.response[key] if call.response is not None else ()


def _value(value: Mapping[str, Any]) -> Any:
    """The value in an rcl_interfaces/msg/ParameterValue, or None where it is not set."""
    return value.get(f"{_TYPES.get(value['type'])}_value")
