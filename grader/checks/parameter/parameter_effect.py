"""The check that a parameter which was set makes the node do something else from then on."""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Iterator
from dataclasses import dataclass, replace
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


@dataclass(frozen=True)
class _Change:
    """The accepted change of the parameter, and the messages that show its effect.

    Attributes:
        asked_ns: When the value was asked for; it was set at ``set_ns``.
        judged: The messages from ``begin_ns`` on, when the effect is due, until ``end_ns``.
    """

    recording: Recording
    parameters: TakesEffect
    asked_ns: int
    set_ns: int
    begin_ns: int
    end_ns: int
    shown: Evidence

    @property
    def judged(self) -> list[Message]:
        published = self.recording.on(self.parameters.topic)
        return [one for one in published if self.begin_ns <= one.stamp_ns < self.end_ns]


@check("parameter.takes_effect", Subject.RECORDING, TakesEffect)
def takes_effect(recording: Recording, parameters: TakesEffect) -> Finding:
    """Setting the parameter changes what the node does.

    Judged by the messages from `within` after the node accepted the value until the same parameter
    was set again or the run ended.
    """
    setting = settings_to(recording, parameters)[0]
    set_ns = setting.call.answered_ns or 0
    shown = evidence_at(recording, f"set to {value_text(setting.value)}", set_ns)
    if not setting.accepted:
        return mistaken("refused_value", f"the value was {refusal(setting)}", shown)
    if not recording.on(parameters.topic):
        stop_if(why_silent(recording, parameters.topic))
    asked_ns = setting.call.requested_ns
    begin_ns = set_ns + round(parameters.within * NS)
    end_ns = _end_ns(recording, parameters, asked_ns)
    change = _Change(recording, parameters, asked_ns, set_ns, begin_ns, end_ns, shown)
    wrong = _why_too_few(change) or _why_other_message(change) or _why_other_period(change)
    if wrong is not None:
        return wrong
    return Finding.as_asked(f"{counted(len(change.judged), 'message')} after it was set", shown)


def _end_ns(recording: Recording, parameters: TakesEffect, asked_ns: int) -> int:
    """When the same parameter was set again, or the run ended."""
    again_ns = (
        setting.call.requested_ns
        for setting in settings(recording, parameters.node, parameters.name)
        if setting.accepted and setting.call.requested_ns > asked_ns
    )
    return min([recording.stop_ns, *again_ns])


def _why_too_few(change: _Change) -> Finding | None:
    recording, parameters, number = change.recording, change.parameters, len(change.judged)
    least = 1 if parameters.period is None else _LEAST_PERIODS + 1
    if number >= least:
        return None
    watched_s = max((change.end_ns - change.begin_ns) / NS, 0.0)
    seen = f"{counted(number, 'message')} in the {format_duration(watched_s)} after that"
    ended = why_ended(recording, seen)
    if ended is not None:
        return ended
    stolen_s = recording.stolen_s(change.begin_ns, change.end_ns)
    if watched_s - stolen_s <= _LEAST_PERIODS * (parameters.period or 0.0):
        return Finding.held_up(f"{seen}, too few to judge", stolen_s)
    raised = why_raised(recording, seen, change.set_ns)
    mistake = "stops_publishing" if parameters.period is None else "old_period"
    return raised or mistaken(mistake, seen, change.shown, off="")


def _why_other_message(change: _Change) -> Finding | None:
    """Why the first message without the expected fields has others; None if there is none."""
    recording, parameters = change.recording, change.parameters
    for message in change.judged:
        wrong = unlike(message.value, parameters.fields, parameters.tolerance)
        if wrong:
            break
    else:
        return None
    late_s = (message.stamp_ns - change.set_ns) / NS
    seen = f"{format_duration(late_s)} after it was set a message has {difference_words(wrong)}"
    taken = why_taken(recording, seen, change.set_ns, message.stamp_ns, parameters.within)
    if taken is not None:
        return taken
    published = recording.on(parameters.topic)
    before = [one.value for one in published if one.stamp_ns < change.asked_ns]
    is_old = before and unlike(before[-1], parameters.fields, parameters.tolerance) == wrong
    shown = replace(change.shown, tables=(difference_table("That message", wrong),))
    name, read = parameters.name, get_parameter(parameters.name)
    mistake = "old_value" if is_old else "other_use"
    return mistaken(mistake, seen, shown, name=name, read=read)


def _why_other_period(change: _Change) -> Finding | None:
    parameters = change.parameters
    if parameters.period is None:
        return None
    times_ns = [message.stamp_ns for message in change.judged]
    median_s = statistics.median(b - a for a, b in itertools.pairwise(times_ns)) / NS
    off_s = median_s - parameters.period
    if abs(off_s) <= parameters.period_tolerance * parameters.period:
        return None
    seen = f"after that, messages come every {format_duration(median_s)} (median)"
    stolen_s = change.recording.stolen_s(times_ns[0], times_ns[-1])
    if 0.0 < off_s * (len(times_ns) - 1) <= stolen_s:
        return Finding.held_up(seen, stolen_s)
    off = f" The period may be {percent(parameters.period_tolerance)} off."
    return mistaken("old_period", seen, change.shown, off=off)
