"""Checks of parameters: declared as they must be, set or refused, and taken from the launch."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Act, Doubt, ParameterSet, ParametersGiven, Stimulated
from grader.checks.wrong_name import Renamable
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_parameter import (
    answered_at,
    declare_parameter,
    why_not_asked,
    why_not_declared,
    why_not_taken,
    why_services_silent,
)
from grader.findings.expected import same, same_value
from grader.findings.fields import wanted_text
from grader.findings.finding import Evidence, Finding, Table, evidence_at
from grader.findings.words import code, codes, listing, value_text
from grader.measure.parameter_calls import (
    Descriptor,
    Reading,
    Setting,
    Type,
    calls_to,
    descriptor,
    misnamed_parameters,
    readings,
    settings,
)
from grader.recording.model import Recording
from grader.spec.name import QualifiedNodeName
from grader.spec.names import Names, Thing, WrongName

_TOLERANCE = 1e-9


class OfParameter(Parameters):
    """Part of the parameters of every check of parameters."""

    doubt = Doubt.ANSWER_MISSED

    node: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    name: str = Field(min_length=1, description="Name of the parameter.")


class Declared(OfParameter):
    """Parameters of parameter.declared."""

    needs = (Stimulated(Act.READ_PARAMETERS, "node"),)

    type: Type | None = Field(None, description="Its type; by default any.")
    default: Any = Field(
        None, description="Its value before it is set; by default any. Lists are exact."
    )
    range: tuple[float, float] | None = Field(
        None, description="Lowest and highest value in its descriptor, [low, high]."
    )
    step: float | None = Field(None, ge=0, description="Step of the range.")
    read_only: bool | None = Field(None, description="Whether it is read-only.")
    described: bool = Field(False, description="Whether its descriptor must have a description.")

    @model_validator(mode="after")
    def _consistent(self) -> Declared:
        if self.range is not None and self.range[0] > self.range[1]:
            raise ValueError(f"the lowest value {self.range[0]:g} is above {self.range[1]:g}")
        if self.step is not None and self.range is None:
            raise ValueError("'step' needs a 'range'")
        return self

    def _asked(self) -> str:
        parts = [_article(self.type)] if self.type else []
        if self.default is not None:
            parts.append(f"{wanted_text(self.default)} at first")
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
    `set_parameters`): type, value before it was set, and descriptor.
    """
    stop_if(why_not_declared(recording, parameters.node, parameters.name))
    found = descriptor(recording, parameters.node, parameters.name)
    assert found is not None
    values = readings(recording, parameters.node, parameters.name)
    shown = _evidence(recording, parameters, found, values)
    stop_if(_why_other_descriptor(found, parameters, shown))
    if parameters.default is not None:
        asked = calls_to(recording, parameters.node, "get_parameters")
        stop_if(why_services_silent(recording, asked))
        if not values:
            stop_if(why_not_asked(recording, parameters.node, "its value was not read"))
        if not same_value(parameters.default, values[0].value):
            declare = declare_parameter(parameters.name, wanted_text(parameters.default))
            seen = f"it is {value_text(values[0].value)} at first"
            return mistaken("other_default", seen, shown, declare=declare)
    value = f", {value_text(values[0].value)}" if values else ""
    return Finding.as_asked(f"{_article(found.type)}{value}", shown)


def _article(kind: str) -> str:
    return f"{'an' if kind.startswith('integer') else 'a'} {kind}"


def _range_words(found: tuple[float, float, float]) -> str:
    low, high, step = found
    return f"{low:g} to {high:g}" + (f" in steps of {step:g}" if step else "")


def _why_other_descriptor(
    found: Descriptor, parameters: Declared, shown: Evidence
) -> Finding | None:
    if parameters.type not in (None, found.type):
        is_integer = (parameters.type, found.type) == ("double", "integer")
        mistake = "integer_parameter" if is_integer else "other_parameter_type"
        declare = declare_parameter(parameters.name)
        return mistaken(mistake, f"it is {_article(found.type)}", shown, declare=declare)
    wanted = list(parameters.range or ())
    if parameters.step is not None:
        wanted.append(parameters.step)
    has_range = found.range is not None and same(wanted, found.range[: len(wanted)], _TOLERANCE)
    if wanted and not has_range:
        kind = "IntegerRange" if found.type == "integer" else "FloatingPointRange"
        seen = f"its range is {_range_words(found.range)}" if found.range else "it has no range"
        return mistaken("other_range", seen, shown, kind=kind)
    if parameters.read_only not in (None, found.read_only):
        seen = "it is read-only" if found.read_only else "it is not read-only"
        return mistaken("read_only", seen, shown, read_only=str(parameters.read_only))
    if parameters.described and not found.description.strip():
        return mistaken("undescribed", "it has no description", shown)
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
    asked = calls_to(recording, parameters.node, "describe_parameters")
    table = Table(f"The parameter {parameters.name}", ("", ""), tuple(rows))
    return Evidence(moments=answered_at(recording, asked), tables=(table,))


class OfSetting(OfParameter):
    """Part of the parameters of parameter.set and parameter.takes_effect."""

    value: Any = Field(description="Value that a `set_parameters` of the scenario sets.")


def settings_to(recording: Recording, parameters: OfSetting) -> tuple[Setting, ...]:
    """The attempts to set a parameter to the value; ends the check if there is none."""
    stop_if(why_not_declared(recording, parameters.node, parameters.name))
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
    """The node's reason for the refusal of a value."""
    return f"refused: {item.reason or 'without a reason'}"


class Set(OfSetting):
    """Parameters of parameter.set."""

    needs = (ParameterSet(),)

    accepted: bool = Field(True, description="Whether the node must accept the value.")
    reason: str = Field(
        "",
        description="A word that the reason of a refusal must contain; upper and lower case do not "
        "matter.",
    )

    def _asked(self) -> str:
        verb = "accepts" if self.accepted else "refuses"
        reason = f", with a reason that says “{self.reason}”" if self.reason else ""
        return f"{code(self.node)} {verb} {self.name} = {value_text(self.value)}{reason}"


@check("parameter.set", Subject.RECORDING, Set)
def set_(recording: Recording, parameters: Set) -> Finding:
    """The parameter is set or refused as expected.

    Judged by the node's answer to `set_parameters`, and by the value that its parameter has after
    it: the new value if it was accepted, the old value if it was refused.
    """
    tried = settings_to(recording, parameters)
    for item in tried:
        stop_if(_why_other_answer(recording, item, parameters))
    observed = "accepted" if tried[0].accepted else refusal(tried[0])
    shown = _moment(recording, tried[0], parameters)
    return Finding.as_asked(observed, shown)


def _why_other_answer(recording: Recording, item: Setting, parameters: Set) -> Finding | None:
    shown = _moment(recording, item, parameters)
    if item.accepted and not parameters.accepted:
        return mistaken("accepted_value", "it was accepted", shown)
    if parameters.accepted and not item.accepted:
        return mistaken("refused_value", f"it was {refusal(item)}", shown)
    if parameters.reason.casefold() not in item.reason.casefold():
        reason = f"is “{item.reason}”" if item.reason else "is empty"
        return mistaken("no_reason", f"it was refused, but the reason {reason}", shown)
    for reading in readings(recording, parameters.node, parameters.name):
        if reading.call.requested_ns >= (item.call.answered_ns or 0):
            if same_value(parameters.value, reading.value) == parameters.accepted:
                return None
            verb = "accepted" if item.accepted else "refused"
            seen = f"it was {verb}, but its value is {value_text(reading.value)} afterwards"
            return mistaken("set_by_itself", seen, shown)
    return None


def _moment(recording: Recording, item: Setting, parameters: Set) -> Evidence:
    text = f"set {parameters.name} = {value_text(item.value)}"
    return evidence_at(recording, text, item.call.requested_ns)


class Given(Renamable):
    """Parameters of parameter.given."""

    doubt = Doubt.ANSWER_MISSED
    needs = (ParametersGiven(),)

    names: tuple[str, ...] = Field(
        (), description="Names of the parameters; by default all that the launch gives."
    )

    def _asked(self) -> str:
        return f"{codes(self.names) or 'every parameter that the launch gives'} declared by a node"


PARAMETERS_GIVEN = "parameter.given"


@check(PARAMETERS_GIVEN, Subject.RECORDING, Given)
def given(recording: Recording, parameters: Given) -> Finding:
    """The node declares the parameters that the launch gives it.

    Judged by what the student's nodes answer when the probe asks for their parameters. Without an
    answer of each node it passes: what the node does is judged by other checks. Where a launch file
    starts the nodes, a parameter file that is for none of them fails, too. If it fails, others
    that fail in the same scenario, without partial credit, are skipped, but for those it requires.
    """
    given = parameters.names or recording.given_parameters
    finding = why_not_taken(recording, given)
    if finding is None:
        return Finding.as_asked("no other parameter is given")
    likely = misnamed_parameters(recording, given) if parameters.remap else {}
    if not likely:
        return finding
    names = Names.of(WrongName(Thing.PARAMETER, other, name) for name, other in likely.items())
    meant = listing(f"{code(other)} for {code(name)}" for name, other in likely.items())
    seen = f"{finding.observed}; everything else was judged with {meant}"
    return replace(finding, observed=seen, names=names)
