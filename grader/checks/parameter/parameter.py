"""Checks of parameters: declared as they must be, set or refused, and with an effect."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment, Table
from grader.checks.need import Doubt, ParameterSet, ParametersRead
from grader.checks.parameter.parameter_calls import (
    Descriptor,
    Range,
    Reading,
    Setting,
    calls_to,
    descriptor,
    names,
    readings,
    settings,
)
from grader.checks.value import same, same_value
from grader.checks.wording import code, codes, value_text
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_destroyed
from grader.diagnosis.no_answer import why_taken, why_unanswered
from grader.diagnosis.no_endpoint import SERVICE, offered
from grader.diagnosis.no_node import why_not_node
from grader.diagnosis.process.process_exit import why_ended
from grader.recording.model import NS, Call, Recording
from grader.spec.name import QualifiedNodeName
from grader.spec.nearest_name import nearest
from grader.spec.unit import format_duration

_ANSWER_S = 1.0
_TOLERANCE = 1e-9

Type = Literal[
    "bool", "integer", "double", "string", "byte_array", "bool_array", "integer_array",
    "double_array", "string_array",
]  # fmt: skip


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


@check("parameter.declared", Subject.RECORDING, Declared)
def declared(recording: Recording, parameters: Declared) -> Finding:
    """The node declares the parameter.

    Judged by the node's own parameter services, which the probe asked (`read_parameters` or
    `set_parameters`): type, value before anybody set it, and descriptor.
    """
    expected = f"the parameter {code(parameters.name)} of {code(parameters.node)}"
    expected += _wanted(parameters)
    cause = why_not_declared(recording, parameters)
    if cause is not None:
        return cause.finding(expected)
    found = descriptor(recording, parameters.node, parameters.name)
    assert found is not None
    values = readings(recording, parameters.node, parameters.name)
    shown = _evidence(recording, parameters.node, found, values)
    cause = _why_other_descriptor(found, parameters, shown) or _why_other_default(
        recording, found, values, parameters, shown
    )
    if cause is not None:
        return cause.finding(expected)
    value = f", {value_text(values[0].value)}" if values else ""
    return Finding.passed(expected, f"{_article(found.type)}{value}", shown)


def _article(kind: str) -> str:
    return f"{'an' if kind.startswith('integer') else 'a'} {kind}"


def _wanted(parameters: Declared) -> str:
    parts = [_article(parameters.type)] if parameters.type else []
    if parameters.default is not None:
        parts.append(f"{value_text(parameters.default)} at first")
    if parameters.range is not None:
        step = f" in steps of {parameters.step:g}" if parameters.step else ""
        parts.append(f"from {parameters.range[0]:g} to {parameters.range[1]:g}{step}")
    if parameters.read_only is not None:
        parts.append("read-only" if parameters.read_only else "not read-only")
    if parameters.described:
        parts.append("with a description")
    return f": {', '.join(parts)}" if parts else ""


def why_not_declared(recording: Recording, parameters: OfParameter) -> Cause | None:
    """Why a parameter is not declared, or None if it is."""
    cause = why_not_node(recording, parameters.node)
    if cause is not None:
        return cause
    asked = (
        *calls_to(recording, parameters.node, "list_parameters"),
        *calls_to(recording, parameters.node, "describe_parameters"),
    )
    if not asked:
        return why_ended(recording) or Cause(
            f"the probe did not ask {code(parameters.node)} for parameters", ours=True
        )
    cause = why_services_silent(recording, parameters.node, asked)
    if cause is not None:
        return cause
    found = descriptor(recording, parameters.node, parameters.name)
    if found is not None and found.type != "not set":
        return None
    there = names(recording, parameters.node) or []
    evidence = Evidence(moments=_answered(recording, asked[:1]))
    if parameters.name in there and found is None:
        return why_not_asked(recording, parameters.node, "what it is was not asked")
    if parameters.name in there:
        return Cause(
            f"{code(parameters.name)} is declared, but without a value",
            f"Give it one: self.declare_parameter('{parameters.name}', default).",
            evidence,
        )
    match = nearest(parameters.name, there)
    seen = f"declared is {code(match)}" if match else f"declared are {codes(there)}"
    return Cause(
        seen if there else "the node declares no parameters",
        f"Call self.declare_parameter('{parameters.name}', default) in the node's constructor.",
        evidence,
    )


def why_services_silent(recording: Recording, node: str, calls: tuple[Call, ...]) -> Cause | None:
    """Why one of some calls to a node's parameter services has no answer, or None."""
    lost = next((call for call in calls if call.answered_ns is None), None)
    if lost is None:
        return None
    service = lost.service.rpartition("/")[2]
    if lost.error == "no server":
        items = offered(recording, SERVICE, lost.service)
        gone = why_destroyed(recording, "it could not be asked", "its parameter service", items)
        if gone is not None:
            return gone
    if lost.error:
        return Cause(
            f"the node has no service {code(service)}"
            if lost.error == "no server"
            else f"{code(lost.service)} could not be called: {lost.error}",
            "Leave start_parameter_services as it is: the parameters of a node are read and set "
            "through its services.",
            Evidence(moments=(Moment("asked", recording.since_launch_s(lost.requested_ns)),)),
            ours=lost.error != "no server",
        )
    what = f"the node's parameter service {code(service)} did not answer"
    return why_unanswered(recording, what, SERVICE, lost.service, lost.requested_ns, _ANSWER_S)


def why_not_asked(recording: Recording, node: str, what: str) -> Cause:
    """Why the probe asked a node's parameter services no more: an answer that was late or lost."""
    calls = [
        call
        for call in recording.calls
        if call.service.rpartition("/")[0] == node and call.request and not call.error
    ]
    lost = why_ended(recording) or why_services_silent(recording, node, tuple(calls[-1:]))
    if lost is not None:
        return lost.after(what)
    slow = calls[-1] if calls else None
    took_s = ((slow.answered_ns or 0) - slow.requested_ns) / NS if slow else 0.0
    if slow is None or took_s <= _ANSWER_S:
        return Cause.to_repeat(f"{what} by the probe")
    seen = (
        f"{what}, because the node's parameter service {code(slow.service.rpartition('/')[2])} "
        f"answered only after {format_duration(took_s)}"
    )
    taken = why_taken(
        recording, seen, slow.requested_ns, slow.answered_ns or recording.stop_ns, _ANSWER_S
    )
    return taken or Cause(
        seen,
        "A callback must return soon: no time.sleep() and no waiting in it. The node answers only "
        "while its executor spins.",
        Evidence(moments=(Moment("asked", recording.since_launch_s(slow.requested_ns)),)),
    )


def _why_other_descriptor(found: Descriptor, parameters: Declared, shown: Evidence) -> Cause | None:
    name = parameters.name
    if parameters.type not in (None, found.type):
        hint = f"The type is that of the default in self.declare_parameter('{name}', default)."
        if (parameters.type, found.type) == ("double", "integer"):
            hint += " 1 is an integer, 1.0 is a double."
        return Cause(f"it is {_article(found.type)}", hint, shown)
    if parameters.range is not None and not _is_range(found.range, parameters):
        kind = "IntegerRange" if found.type == "integer" else "FloatingPointRange"
        return Cause(
            f"its range is {_range_words(found.range)}" if found.range else "it has no range",
            f"Give declare_parameter() a ParameterDescriptor with a {kind}(from_value=..., "
            "to_value=..., step=...).",
            shown,
        )
    if parameters.read_only not in (None, found.read_only):
        return Cause(
            "it is read-only" if found.read_only else "it is not read-only",
            f"ParameterDescriptor(read_only={parameters.read_only}).",
            shown,
        )
    if parameters.described and not found.description.strip():
        return Cause("it has no description", "ParameterDescriptor(description='...').", shown)
    return None


def _is_range(found: Range | None, wanted: Declared) -> bool:
    if found is None or wanted.range is None:
        return False
    ends = same(list(wanted.range), [found.low, found.high], _TOLERANCE)
    return ends and (wanted.step is None or same(wanted.step, found.step, _TOLERANCE))


def _range_words(found: Range) -> str:
    step = f" in steps of {found.step:g}" if found.step else ""
    return f"{found.low:g} to {found.high:g}{step}"


def _why_other_default(
    recording: Recording,
    found: Descriptor,
    values: tuple[Reading, ...],
    parameters: Declared,
    shown: Evidence,
) -> Cause | None:
    if parameters.default is None:
        return None
    asked = calls_to(recording, parameters.node, "get_parameters")
    cause = why_services_silent(recording, parameters.node, asked)
    if cause is not None or not values:
        return cause or why_not_asked(recording, parameters.node, "its value was not asked")
    if same_value(parameters.default, values[0].value):
        return None
    return Cause(
        f"it is {value_text(values[0].value)} at first",
        f"Its default is the second argument: self.declare_parameter('{found.name}', "
        f"{value_text(parameters.default)}).",
        shown,
    )


def _evidence(
    recording: Recording, node: str, found: Descriptor, values: tuple[Reading, ...]
) -> Evidence:
    rows = [
        ("type", found.type),
        ("range", _range_words(found.range) if found.range else "none"),
        ("read-only", value_text(found.read_only)),
        ("description", found.description or "none"),
    ]
    rows += [
        (
            f"value at {recording.since_launch_s(item.call.requested_ns):.2f} s",
            value_text(item.value),
        )
        for item in values[:20]
    ]
    table = Table(f"The parameter {found.name}", ("", ""), tuple(rows))
    asked = calls_to(recording, node, "describe_parameters")
    return Evidence(moments=_answered(recording, asked[:1]), tables=(table,))


def _answered(recording: Recording, calls: tuple[Call, ...]) -> tuple[Moment, ...]:
    """When the node answered."""
    return tuple(
        Moment(
            f"{call.service.rpartition('/')[2]} was answered",
            recording.since_launch_s(call.answered_ns),
        )
        for call in calls
        if call.answered_ns is not None
    )


class Set(OfParameter):
    """Parameters of parameter.set."""

    needs = (ParameterSet(),)

    value: Any = Field(description="What a `set_parameters` of the scenario sets it to.")
    accepted: bool = Field(True, description="Whether the node must accept it, or refuse it.")
    reason: str = Field(
        "", description="A word that the reason of a refusal must hold, upper and lower case alike."
    )


@check("parameter.set", Subject.RECORDING, Set)
def set_(recording: Recording, parameters: Set) -> Finding:
    """The parameter can be set, or is refused, as expected.

    Judged by the node's answer to `set_parameters`, and by the value that its parameter has
    after it: accepted, it is the new one; refused, it is the one from before.
    """
    verb = "accepts" if parameters.accepted else "refuses"
    expected = f"{code(parameters.node)} {verb} {parameters.name} = {value_text(parameters.value)}"
    expected += f", with a reason that says “{parameters.reason}”" if parameters.reason else ""
    cause = why_not_declared(recording, parameters)
    if cause is not None:
        return cause.finding(expected)
    tried = [
        item
        for item in settings(recording, parameters.node, parameters.name)
        if same_value(parameters.value, item.value)
    ]
    if not tried:
        return why_not_asked(recording, parameters.node, "it was not set").finding(expected)
    asked = tuple(item.call for item in tried)
    cause = why_services_silent(recording, parameters.node, asked)
    for item in tried:
        cause = cause or _why_otherwise(recording, item, parameters)
    if cause is not None:
        return cause.finding(expected)
    told = "accepted" if tried[0].accepted else f"refused: {tried[0].reason or 'without a reason'}"
    return Finding.passed(expected, told, _moment(recording, tried[0], parameters))


def _why_otherwise(recording: Recording, item: Setting, parameters: Set) -> Cause | None:
    shown = _moment(recording, item, parameters)
    if item.accepted is None:
        return Cause("the node gave no result for it", ours=True)
    after = [
        reading
        for reading in readings(recording, parameters.node, parameters.name)
        if reading.call.requested_ns >= (item.call.answered_ns or 0)
    ]
    is_new = bool(after) and same_value(parameters.value, after[0].value)
    if not parameters.accepted and item.accepted:
        return Cause(
            "it was accepted",
            "Register a callback with self.add_on_set_parameters_callback() that returns "
            "SetParametersResult(successful=False, reason='...') for such a value, or give the "
            "parameter a range.",
            shown,
        )
    if parameters.accepted and not item.accepted:
        why = f": {item.reason}" if item.reason else ", without a reason"
        return Cause(
            f"it was refused{why}",
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
    if after and is_new != parameters.accepted:
        became = value_text(after[0].value)
        return Cause(f"it was {'accepted' if item.accepted else 'refused'}, but is {became} then",
                     "Do not set the parameter yourself in the callback.", shown)  # fmt: skip
    return None


def _moment(recording: Recording, item: Setting, parameters: Set) -> Evidence:
    text = f"set {parameters.name} = {value_text(item.value)}"
    return Evidence(moments=(Moment(text, recording.since_launch_s(item.call.requested_ns)),))
