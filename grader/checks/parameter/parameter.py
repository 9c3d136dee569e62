"""Checks of parameters: declared as they must be, and set or refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, repeat
from typing import Any, Literal, get_args

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.finding import Evidence, Finding, Moment, Table
from grader.checks.need import Doubt, ParameterSet, ParametersRead
from grader.checks.requests import NO_SERVER, why_late
from grader.checks.value import same, same_value
from grader.checks.wording import code, codes, value_text
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_answer import why_unanswered
from grader.diagnosis.no_node import why_not_node
from grader.diagnosis.no_server import SERVICE
from grader.diagnosis.process.process_exit import why_ended
from grader.recording.model import Call, Recording
from grader.spec.name import QualifiedNodeName
from grader.spec.nearest_name import nearest

_ANSWER_S = 1.0
_TOLERANCE = 1e-9


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
    return tuple(
        Reading(call, _value(value))
        for call in calls_to(recording, node, "get_parameters")
        for asked, value in zip(
            (call.request or {})["names"], _answered(call, "values"), strict=False
        )
        if asked == name
    )


def settings(recording: Recording, node: str, name: str) -> tuple[Setting, ...]:
    """Every attempt to set a parameter."""
    return tuple(
        Setting(call, _value(wanted["value"]), result["successful"], result["reason"])
        for call in calls_to(recording, node, "set_parameters")
        for wanted, result in zip(
            (call.request or {})["parameters"],
            chain(_answered(call, "results"), repeat(_NO_RESULT)),
            strict=False,
        )
        if wanted["name"] == name
    )


def _answered(call: Call, key: str) -> Sequence[Any]:
    return call.response[key] if call.response is not None else ()


def _value(value: Mapping[str, Any]) -> Any:
    """The value in an rcl_interfaces/msg/ParameterValue, or None where it is not set."""
    return value.get(f"{_TYPES.get(value['type'])}_value")


class OfParameter(Parameters):
    """Part of the parameters of every check of parameters."""

    doubt = Doubt.ANSWER_MISSED

    node: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    name: str = Field(min_length=1, description="Name of the parameter.")


class Declared(OfParameter):
    """Parameters of parameter.declared."""

    needs = (ParametersRead(),)

    type: Type | None = Field(None, description="Its type; by default any.")
    default: Any = Field(
        None, description="Its value before anybody sets it; by default any. Lists are exact."
    )
    range: tuple[float, float] | None = Field(
        None, description="Lowest and highest value that its descriptor allows, [low, high]."
    )
    step: float | None = Field(None, ge=0, description="Step of the range.")
    read_only: bool | None = Field(None, description="Whether it can never be set.")
    described: bool = Field(False, description="Whether its descriptor has to have a description.")

    @model_validator(mode="after")
    def _consistent(self) -> Declared:
        if self.range is not None and self.range[0] > self.range[1]:
            raise ValueError(f"the lowest value {self.range[0]:g} is above {self.range[1]:g}")
        if self.step is not None and self.range is None:
            raise ValueError("'step' needs a 'range'")
        return self

    @property
    def asked_for(self) -> str:
        """The declaration in words."""
        parts = [_article(self.type)] if self.type else []
        if self.default is not None:
            parts.append(f"{value_text(self.default)} at first")
        if self.range is not None:
            parts.append(f"from {_range_words((*self.range, self.step or 0.0))}")
        if self.read_only is not None:
            parts.append("read-only" if self.read_only else "not read-only")
        if self.described:
            parts.append("with a description")
        wanted = f": {', '.join(parts)}" if parts else ""
        return f"the parameter {code(self.name)} of {code(self.node)}{wanted}"


@check("parameter.declared", Subject.RECORDING, Declared)
def declared(recording: Recording, parameters: Declared) -> Finding:
    """The node declares the parameter.

    Judged by the node's own parameter services, which the probe asked (`read_parameters` or
    `set_parameters`): type, value before anybody set it, and descriptor.
    """
    found = found_declared(recording, parameters)
    values = readings(recording, parameters.node, parameters.name)
    shown = _evidence(recording, parameters, found, values)
    stop_if(_why_other_descriptor(found, parameters, shown))
    if parameters.default is not None:
        asked = calls_to(recording, parameters.node, "get_parameters")
        stop_if(why_services_silent(recording, asked))
        if not values:
            stop_if(why_not_asked(recording, parameters.node, "its value was not read"))
        if not same_value(parameters.default, values[0].value):
            return Finding.failed(
                parameters.asked_for,
                f"it is {value_text(values[0].value)} at first",
                "Its default is the second argument: self.declare_parameter("
                f"'{parameters.name}', {value_text(parameters.default)}).",
                shown,
            )
    value = f", {value_text(values[0].value)}" if values else ""
    return Finding.passed(parameters.asked_for, f"{_article(found.type)}{value}", shown)


def _article(kind: str) -> str:
    return f"{'an' if kind.startswith('integer') else 'a'} {kind}"


def _range_words(found: tuple[float, float, float]) -> str:
    low, high, step = found
    return f"{low:g} to {high:g}" + (f" in steps of {step:g}" if step else "")


def found_declared(recording: Recording, parameters: OfParameter) -> Descriptor:
    """How a parameter is declared; ends the check if it is not."""
    node, name = parameters.node, parameters.name
    stop_if(why_not_node(recording, node))
    asked = calls_to(recording, node, "list_parameters", "describe_parameters")
    if not asked:
        never = Cause(f"the probe did not ask {code(node)} for parameters", ours=True)
        stop_if(why_ended(recording) or never)
    stop_if(why_services_silent(recording, asked))
    found = descriptor(recording, node, name)
    if found is not None and found.type != "not set":
        return found
    there = names(recording, node)
    if name in there and found is None:
        stop_if(why_not_asked(recording, node, "its descriptor was not read"))
    match = nearest(name, there)
    seen = f"declared is {code(match)}" if match else f"declared are {codes(there)}"
    if name in there:
        seen = f"{code(name)} is declared, but without a value"
    stop_if(
        Cause(
            seen if there else "the node declares no parameters",
            f"Call self.declare_parameter('{name}', default) in the node's constructor.",
            _when(recording, asked[0], "answered"),
        )
    )
    raise AssertionError


def why_services_silent(recording: Recording, calls: tuple[Call, ...]) -> Cause | None:
    """Why one of some calls to a node's parameter services has no answer, or None."""
    lost = next((call for call in calls if call.answered_ns is None), None)
    if lost is None:
        return None
    service = code(lost.service.rpartition("/")[2])
    if not lost.error:
        what = f"the node's parameter service {service} did not answer"
        return why_unanswered(recording, what, SERVICE, lost.service, lost.requested_ns, _ANSWER_S)
    is_missing = lost.error == NO_SERVER
    return Cause(
        f"the node has no service {service}"
        if is_missing
        else f"{service} could not be asked: {lost.error}",
        "Leave start_parameter_services as it is: the parameters of a node are read and set "
        "through its services.",
        _when(recording, lost, "asked"),
        ours=not is_missing,
    )


def why_not_asked(recording: Recording, node: str, what: str) -> Cause:
    """Why the probe asked a node's parameter services no more: an answer was late or lost."""
    ended = why_ended(recording)
    calls = [
        call
        for call in recording.calls
        if call.service.rpartition("/")[0] == node and call.request and not call.error
    ]
    for last in [] if ended else calls[-1:]:
        server, asked_ns, end_ns = last.service, last.requested_ns, last.answered_ns
        seen = f"the node's parameter service {code(server.rpartition('/')[2])} did not answer"
        hint = (
            "A callback must return soon: no time.sleep() and no waiting in it. The node answers "
            "only while its executor spins."
        )
        shown = _when(recording, last, "asked")
        ended = why_late(recording, SERVICE, server, asked_ns, end_ns, _ANSWER_S, seen, hint, shown)
    return ended.after(what) if ended else Cause.to_repeat(f"{what} by the probe")


def _when(recording: Recording, call: Call, what: str) -> Evidence:
    """When a call was asked, or answered."""
    at_ns = call.requested_ns if what == "asked" else call.answered_ns or call.requested_ns
    text = f"{call.service.rpartition('/')[2]} was {what}"
    return Evidence(moments=(Moment(text, recording.since_launch_s(at_ns)),))


def _why_other_descriptor(found: Descriptor, parameters: Declared, shown: Evidence) -> Cause | None:
    if parameters.type not in (None, found.type):
        hint = f"The type is that of the default in self.declare_parameter('{parameters.name}', "
        hint += "default)."
        if (parameters.type, found.type) == ("double", "integer"):
            hint += " 1 is an integer, 1.0 is a double."
        return Cause(f"it is {_article(found.type)}", hint, shown)
    wanted = [*(parameters.range or ()), *([] if parameters.step is None else [parameters.step])]
    if wanted and not (found.range and same(wanted, found.range[: len(wanted)], _TOLERANCE)):
        kind = "IntegerRange" if found.type == "integer" else "FloatingPointRange"
        return Cause(
            f"its range is {_range_words(found.range)}" if found.range else "it has no range",
            f"Give declare_parameter() a ParameterDescriptor with a {kind}(from_value=..., "
            "to_value=..., step=...).",
            shown,
        )
    if parameters.read_only not in (None, found.read_only):
        seen = "it is read-only" if found.read_only else "it is not read-only"
        return Cause(seen, f"ParameterDescriptor(read_only={parameters.read_only}).", shown)
    if parameters.described and not found.description.strip():
        return Cause("it has no description", "ParameterDescriptor(description='...').", shown)
    return None


def _evidence(
    recording: Recording, parameters: Declared, found: Descriptor, values: tuple[Reading, ...]
) -> Evidence:
    rows = [
        ("type", found.type),
        ("range", _range_words(found.range) if found.range else "none"),
        ("read-only", value_text(found.read_only)),
        ("description", found.description or "none"),
    ]
    for item in values[:20]:
        at_s = recording.since_launch_s(item.call.requested_ns)
        rows.append((f"value at {at_s:.2f} s", value_text(item.value)))
    asked = calls_to(recording, parameters.node, "describe_parameters")[0]
    table = Table(f"The parameter {parameters.name}", ("", ""), tuple(rows))
    return replace(_when(recording, asked, "answered"), tables=(table,))


class OfSetting(OfParameter):
    """Part of the parameters of parameter.set and parameter.takes_effect."""

    value: Any = Field(description="What a `set_parameters` of the scenario sets it to.")


def settings_to(recording: Recording, parameters: OfSetting) -> tuple[Setting, ...]:
    """The attempts to set a parameter to the value; ends the check if there is none."""
    found_declared(recording, parameters)
    tried = tuple(
        item
        for item in settings(recording, parameters.node, parameters.name)
        if same_value(parameters.value, item.value)
    )
    if not tried:
        stop_if(why_not_asked(recording, parameters.node, "it was not set"))
    stop_if(why_services_silent(recording, tuple(item.call for item in tried)))
    return tried


def refusal(item: Setting) -> str:
    """What the node said when it refused a value."""
    return f"refused: {item.reason or 'without a reason'}"


class Set(OfSetting):
    """Parameters of parameter.set."""

    needs = (ParameterSet(),)

    accepted: bool = Field(True, description="Whether the node must accept it, or refuse it.")
    reason: str = Field(
        "", description="A word that the reason of a refusal must hold, upper and lower case alike."
    )

    @property
    def asked_for(self) -> str:
        """The answer in words."""
        verb = "accepts" if self.accepted else "refuses"
        reason = f", with a reason that says “{self.reason}”" if self.reason else ""
        return f"{code(self.node)} {verb} {self.name} = {value_text(self.value)}{reason}"


@check("parameter.set", Subject.RECORDING, Set)
def set_(recording: Recording, parameters: Set) -> Finding:
    """The parameter can be set, or is refused, as expected.

    Judged by the node's answer to `set_parameters`, and by the value that its parameter has
    after it: accepted, it is the new one; refused, it is the one from before.
    """
    tried = settings_to(recording, parameters)
    for item in tried:
        stop_if(_why_other_answer(recording, item, parameters))
    observed = "accepted" if tried[0].accepted else refusal(tried[0])
    shown = _moment(recording, tried[0], parameters)
    return Finding.passed(parameters.asked_for, observed, shown)


def _why_other_answer(recording: Recording, item: Setting, parameters: Set) -> Cause | None:
    shown = _moment(recording, item, parameters)
    if item.accepted and not parameters.accepted:
        return Cause(
            "it was accepted",
            "Register a callback with self.add_on_set_parameters_callback() that returns "
            "SetParametersResult(successful=False, reason='...') for such a value, or give the "
            "parameter a range.",
            shown,
        )
    if parameters.accepted and not item.accepted:
        return Cause(
            f"it was {refusal(item)}",
            "Look at the callback of add_on_set_parameters_callback() and at the range: both "
            "must allow it.",
            shown,
        )
    if parameters.reason.casefold() not in item.reason.casefold():
        said = f"“{item.reason}”" if item.reason else "nothing"
        return Cause(
            f"it was refused, but the reason says {said}",
            "SetParametersResult(successful=False, reason='...') tells why.",
            shown,
        )
    for reading in readings(recording, parameters.node, parameters.name):
        if reading.call.requested_ns >= (item.call.answered_ns or 0):
            if same_value(parameters.value, reading.value) == parameters.accepted:
                return None
            verb = "accepted" if item.accepted else "refused"
            seen = f"it was {verb}, but is {value_text(reading.value)} then"
            return Cause(seen, "Do not set the parameter yourself in the callback.", shown)
    return None


def _moment(recording: Recording, item: Setting, parameters: Set) -> Evidence:
    text = f"set {parameters.name} = {value_text(item.value)}"
    return Evidence(moments=(Moment(text, recording.since_launch_s(item.call.requested_ns)),))
