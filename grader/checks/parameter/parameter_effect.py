"""The check that a parameter which was set makes the node do something else from then on."""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from pydantic import Field, model_validator

from grader.checks.check import NamedFields, Subject, check, stop_if, toleranced
from grader.checks.need import ParameterSet, Recorded
from grader.checks.parameter.parameter import OfSetting, refusal, settings_to
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_answer import why_taken
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.no_parameter import get_parameter
from grader.diagnosis.process.not_called import why_raised
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.fields import FieldTolerance, difference_table, difference_words, unlike, words
from grader.findings.finding import Evidence, Finding, evidence_at
from grader.findings.value import EXACT
from grader.findings.words import code, counted, percent, value_text
from grader.measure.parameter_calls import settings
from grader.recording.model import NS, Message, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration, Ratio
from grader.spec.unit import format_duration

_LEAST_PERIODS = 3


class TakesEffect(OfSetting):
    """Parameters of parameter.takes_effect."""

    needs = (ParameterSet(), Recorded())

    topic: TopicName = Field(description="Recorded topic that shows the effect.")
    fields: dict[str, Any] = Field(
        default_factory=dict,
        description="Expected fields of the messages after that, nested or by path. Other fields "
        "do not matter.",
    )
    period: Duration | None = Field(
        None, description="Expected time between two messages after that."
    )
    tolerance: FieldTolerance = EXACT
    period_tolerance: Ratio = Field(
        0.05, description="How far the median of the intervals may be from the period."
    )
    within: Duration = Field(0.5, description="Longest time until the effect.")

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields that change."""
        return toleranced("fields", self.topic, self.fields, self.tolerance)

    @model_validator(mode="after")
    def _something(self) -> TakesEffect:
        if not self.fields and self.period is None:
            raise ValueError("say what changes: 'fields' or 'period'")
        return self

    def _asked(self) -> str:
        parts = [words(self.fields)] if self.fields else []
        if self.period is not None:
            parts.append(f"a message every {format_duration(self.period)}")
        return (
            f"{' and '.join(parts)} on {code(self.topic)}, {format_duration(self.within)} "
            f"or more after {self.name} = {value_text(self.value)} was set"
        )


@check("parameter.takes_effect", Subject.RECORDING, TakesEffect)
def takes_effect(recording: Recording, parameters: TakesEffect) -> Finding:
    """Setting the parameter changes what the node does.

    Judged by the messages from `within` after the node accepted the value until the same parameter
    was set again or the run ended.
    """
    item = settings_to(recording, parameters)[0]
    set_ns = item.call.answered_ns or 0
    shown = evidence_at(recording, f"set to {value_text(item.value)}", set_ns)
    if not item.accepted:
        return mistaken("refused_value", f"the value was {refusal(item)}", shown)
    published = recording.on(parameters.topic)
    if not published:
        stop_if(why_silent(recording, parameters.topic))
    again_ns = [
        other.call.requested_ns
        for other in settings(recording, parameters.node, parameters.name)
        if other.accepted and other.call.requested_ns > item.call.requested_ns
    ]
    begin_ns, end_ns = set_ns + round(parameters.within * NS), min([recording.stop_ns, *again_ns])
    found = [one for one in published if begin_ns <= one.stamp_ns < end_ns]
    stop_if(_why_too_few(recording, parameters, len(found), begin_ns, end_ns, shown))
    before = [one for one in published if one.stamp_ns < item.call.requested_ns]
    for message in found:
        stop_if(_why_other_message(recording, parameters, message, before[-1:], set_ns, shown))
    stop_if(_why_other_period(recording, parameters, found, shown))
    return Finding.as_asked(f"{counted(len(found), 'message')} after it was set", shown)


def _why_too_few(
    recording: Recording,
    parameters: TakesEffect,
    number: int,
    begin_ns: int,
    end_ns: int,
    shown: Evidence,
) -> Finding | None:
    if number >= (1 if parameters.period is None else _LEAST_PERIODS + 1):
        return None
    watched_s = max((end_ns - begin_ns) / NS, 0.0)
    seen = f"{counted(number, 'message')} in the {format_duration(watched_s)} after that"
    ended = why_ended(recording, seen)
    if ended is not None:
        return ended
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    if watched_s - stolen_s <= _LEAST_PERIODS * (parameters.period or 0.0):
        return Finding.held_up(f"{seen}, too few to judge", stolen_s)
    raised = why_raised(recording, seen, begin_ns - round(parameters.within * NS))
    mistake = "stops_publishing" if parameters.period is None else "old_period"
    return raised or mistaken(mistake, seen, shown, off="")


def _why_other_message(
    recording: Recording,
    parameters: TakesEffect,
    message: Message,
    before: Sequence[Message],
    set_ns: int,
    shown: Evidence,
) -> Finding | None:
    wrong = unlike(message.value, parameters.fields, parameters.tolerance)
    if not wrong:
        return None
    late_s = (message.stamp_ns - set_ns) / NS
    seen = f"{format_duration(late_s)} after it was set a message has {difference_words(wrong)}"
    was_before = [unlike(one.value, parameters.fields, parameters.tolerance) for one in before]
    mistake = "old_value" if wrong in was_before else "other_use"
    taken = why_taken(recording, seen, set_ns, message.stamp_ns, parameters.within)
    table = difference_table("That message", wrong)
    shown = replace(shown, tables=(table,))
    name, read = parameters.name, get_parameter(parameters.name)
    return taken or mistaken(mistake, seen, shown, name=name, read=read)


def _why_other_period(
    recording: Recording, parameters: TakesEffect, found: list[Message], shown: Evidence
) -> Finding | None:
    if parameters.period is None:
        return None
    times = [message.stamp_ns for message in found]
    median_s = statistics.median(b - a for a, b in itertools.pairwise(times)) / NS
    off_s = median_s - parameters.period
    if abs(off_s) <= parameters.period_tolerance * parameters.period:
        return None
    seen = f"after that, messages come every {format_duration(median_s)} (median)"
    stolen_s = recording.stolen_s(times[0], times[-1])
    if 0.0 < off_s * (len(times) - 1) <= stolen_s:
        return Finding.held_up(seen, stolen_s)
    off = f" The period may be {percent(parameters.period_tolerance)} off."
    return mistaken("old_period", seen, shown, off=off)
