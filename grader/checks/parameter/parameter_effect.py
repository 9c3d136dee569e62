"""The check that a parameter which was set makes the node do something else from then on."""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Iterator, Sequence
from typing import Any

from pydantic import Field, model_validator

from grader.checks.check import NamedFields, Subject, check
from grader.checks.fields import (
    FieldTolerance,
    difference_table,
    difference_words,
    toleranced,
    unlike,
)
from grader.checks.fields import words as fields_words
from grader.checks.finding import Evidence, Finding, Moment
from grader.checks.need import ParameterSet, Recorded
from grader.checks.parameter.parameter import (
    OfParameter,
    why_not_asked,
    why_not_declared,
    why_services_silent,
)
from grader.checks.parameter.parameter_calls import Setting, settings
from grader.checks.value import EXACT, Difference, NoSuchField, same_value
from grader.checks.wording import code, counted, percent, value_text
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_answer import why_raised, why_taken
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.process.process_exit import why_ended
from grader.recording.model import NS, Message, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration, Ratio
from grader.spec.unit import format_duration

_LEAST_PERIODS = 3


class TakesEffect(OfParameter):
    """Parameters of parameter.takes_effect."""

    needs = (ParameterSet(), Recorded())

    value: Any = Field(description="What a `set_parameters` of the scenario sets it to.")
    topic: TopicName = Field(description="Recorded topic on which the effect shows.")
    fields: dict[str, Any] = Field(
        default_factory=dict,
        description="What messages have then, nested or by path; other fields do not matter.",
    )
    period: Duration | None = Field(None, description="Time between two messages then.")
    tolerance: FieldTolerance = EXACT
    period_tolerance: Ratio = Field(
        0.05, description="How far the median of the intervals may be from the period."
    )
    within: Duration = Field(
        0.5,
        description="How soon after it was set, by default 500 ms.",
        validate_default=False,
    )

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields that change."""
        return toleranced("fields", self.topic, self.fields, self.tolerance)

    @model_validator(mode="after")
    def _something(self) -> TakesEffect:
        if not self.fields and self.period is None:
            raise ValueError("say what changes: 'fields' or 'period'")
        return self

    @property
    def words(self) -> str:
        """The effect in words."""
        parts = [fields_words(self.fields)] if self.fields else []
        if self.period is not None:
            parts.append(f"a message every {format_duration(self.period)}")
        return " and ".join(parts)


@check("parameter.takes_effect", Subject.RECORDING, TakesEffect)
def takes_effect(recording: Recording, parameters: TakesEffect) -> Finding:
    """A parameter that is set changes what the node does.

    Judged by the messages that were published from a moment after the node accepted the value
    until the same parameter was set again, or the run ended.
    """
    shown = f"{parameters.name} = {value_text(parameters.value)}"
    expected = (
        f"{parameters.words} on {code(parameters.topic)} from "
        f"{format_duration(parameters.within)} after {shown} was set"
    )
    cause = why_not_declared(recording, parameters)
    if cause is not None:
        return cause.finding(expected)
    every = settings(recording, parameters.node, parameters.name)
    tried = [item for item in every if same_value(parameters.value, item.value)]
    if not tried:
        return why_not_asked(recording, parameters.node, "it was not set").finding(expected)
    item = tried[0]
    lost = why_services_silent(recording, parameters.node, (item.call,))
    if lost is not None:
        return lost.finding(expected)
    if not item.accepted:
        return Finding.failed(
            expected,
            f"the value was refused: {item.reason or 'without a reason'}",
            "Look at the callback of add_on_set_parameters_callback() and at the range.",
            _evidence(recording, item),
        )
    try:
        cause = _why_no_effect(recording, parameters, item, _end_ns(recording, every, item))
    except NoSuchField as error:
        return Finding.error(
            expected, f"the assignment expects what a message there cannot be: {error}"
        )
    if cause is not None:
        return cause.finding(expected)
    number = len(_after(recording, parameters, item, _end_ns(recording, every, item)))
    return Finding.passed(
        expected, f"{counted(number, 'message')} after it was set", _evidence(recording, item)
    )


def _end_ns(recording: Recording, every: tuple[Setting, ...], item: Setting) -> int:
    """When the parameter was set again, or the end."""
    later = [
        other.call.requested_ns
        for other in every
        if other.accepted and other.call.requested_ns > item.call.requested_ns
    ]
    return min([recording.stop_ns, *later])


def _after(
    recording: Recording, parameters: TakesEffect, item: Setting, end_ns: int
) -> list[Message]:
    begin_ns = (item.call.answered_ns or 0) + round(parameters.within * NS)
    return [one for one in recording.on(parameters.topic) if begin_ns <= one.stamp_ns < end_ns]


def _why_no_effect(
    recording: Recording, parameters: TakesEffect, item: Setting, end_ns: int
) -> Cause | None:
    if not recording.on(parameters.topic):
        return why_silent(recording, parameters.topic)
    set_ns = item.call.answered_ns or 0
    found = _after(recording, parameters, item, end_ns)
    shown = _evidence(recording, item)
    needed = 1 if parameters.period is None else _LEAST_PERIODS + 1
    if len(found) < needed:
        return _too_few(recording, parameters, item, end_ns, len(found))
    for message in found:
        wrong = unlike(message.value, parameters.fields, parameters.tolerance)
        if not wrong:
            continue
        late_s = (message.stamp_ns - set_ns) / NS
        seen = f"{format_duration(late_s)} after it was set a message has {difference_words(wrong)}"
        return why_taken(recording, seen, set_ns, message.stamp_ns, parameters.within) or Cause(
            seen,
            _no_effect_hint(recording, parameters, item, wrong),
            Evidence(shown.moments, tables=(difference_table("That message", wrong),)),
        )
    return _why_other_period(recording, parameters, found, shown)


def _no_effect_hint(
    recording: Recording, parameters: TakesEffect, item: Setting, wrong: Sequence[Difference]
) -> str:
    """What to try where the fields of a message are not what the new value should make of them."""
    before = [
        one for one in recording.on(parameters.topic) if one.stamp_ns < item.call.requested_ns
    ]
    if before and wrong == unlike(before[-1].value, parameters.fields, parameters.tolerance):
        return (
            "The message is as it was before: read "
            f"self.get_parameter('{parameters.name}').value in the callback, or keep the new value "
            "in add_post_set_parameters_callback()."
        )
    return f"Look what the node makes of {code(parameters.name)} where it publishes."


def _too_few(
    recording: Recording, parameters: TakesEffect, item: Setting, end_ns: int, number: int
) -> Cause:
    begin_ns = (item.call.answered_ns or 0) + round(parameters.within * NS)
    watched_s = (end_ns - begin_ns) / NS
    seen = f"{counted(number, 'message')} in the {format_duration(max(watched_s, 0.0))} after that"
    ended = why_ended(recording, seen)
    if ended is not None:
        return ended
    due_s = _LEAST_PERIODS * (parameters.period or 0.0)
    if watched_s <= due_s:
        return Cause.to_repeat(f"{seen}: the scenario is too short to judge")
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    if stolen_s > 0.0 and watched_s - stolen_s <= due_s:
        return Cause.to_repeat(f"{seen}, but the machine took {format_duration(stolen_s)}")
    return why_raised(recording, seen, item.call.requested_ns) or Cause(
        seen,
        "Publish in every call of the callback, whatever the value of the parameter is."
        if parameters.period is None
        else "A timer whose period changes has to be made anew: self.timer.cancel(), then "
        "self.create_timer(period, self.callback); or set self.timer.timer_period_ns.",
        _evidence(recording, item),
    )


def _why_other_period(
    recording: Recording, parameters: TakesEffect, found: list[Message], shown: Evidence
) -> Cause | None:
    if parameters.period is None:
        return None
    times = [message.stamp_ns for message in found]
    median_s = statistics.median(b - a for a, b in itertools.pairwise(times)) / NS
    off_s = abs(median_s - parameters.period)
    if off_s <= parameters.period_tolerance * parameters.period:
        return None
    seen = f"messages come every {format_duration(median_s)} (median) then"
    if median_s > parameters.period and recording.stolen_s(times[0], times[-1]) >= off_s * (
        len(times) - 1
    ):
        return Cause.to_repeat(f"{seen}, but the machine took the time")
    return Cause(
        seen,
        "A timer keeps its period: make it anew in add_post_set_parameters_callback(), or set "
        f"self.timer.timer_period_ns. The period may be {percent(parameters.period_tolerance)} "
        "off.",
        shown,
    )


def _evidence(recording: Recording, item: Setting) -> Evidence:
    text = f"set to {value_text(item.value)}"
    when_ns = item.call.answered_ns or item.call.requested_ns
    return Evidence(moments=(Moment(text, recording.since_launch_s(when_ns)),))
