"""The check of what a client asks of a service or an action that the scenario serves."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

from pydantic import Field

from grader.checks.check import NamedFields, Parameters, Subject, check, stop_if
from grader.checks.need import Act, Doubt, Stimulated
from grader.checks.requests import why_other_fields
from grader.diagnosis.explanation import mistaken, remedy
from grader.diagnosis.no_answer import why_taken
from grader.diagnosis.not_asked import evidence, why_not_asked
from grader.findings.fields import FieldTolerance, brief, unlike, words
from grader.findings.finding import Evidence, Finding
from grader.findings.value import EXACT
from grader.findings.words import code, counted
from grader.recording.interaction import Asked
from grader.recording.model import NS, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration


class Asks(Parameters):
    """Parameters of client.asks."""

    needs = (Stimulated(Act.SERVE, "server"),)
    doubt = Doubt.ANSWER_MISSED

    server: TopicName = Field(description="Service or action of a `serve` of the scenario.")
    sequence: tuple[dict[str, Any], ...] = Field(
        ({},),
        min_length=1,
        description="Requests or goals in order, each with the fields that matter; `{}` for any. "
        "By default one.",
    )
    more: bool = Field(False, description="Whether more may follow.")
    after_result: bool = Field(
        False,
        description="Whether each must wait for the response, or the end of the goal, before. Give "
        "the answers of the scenario a `delay` or `takes`: else nothing comes too early.",
    )
    tolerance: FieldTolerance = EXACT
    cancels: tuple[Duration, Duration] | None = Field(
        None,
        description="Shortest and longest time from the acceptance of the last goal of `sequence` "
        "to the client's request to cancel it.",
    )

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields of each request or goal."""
        for number, fields in enumerate(self.sequence):
            place = ("sequence", number)
            yield NamedFields(place, self.server, fields, tolerance=self.tolerance)

    def _asked(self) -> str:
        wanted = "; ".join(words(fields) if fields else "anything" for fields in self.sequence)
        what = f" for {wanted}" if self.sequence != ({},) else ""
        order = ", each after the result of the one before" if self.after_result else ""
        span = map(format_duration, self.cancels or ())
        cancels = f", and cancels the last one after {' to '.join(span)}" if self.cancels else ""
        return f"the client asks {code(self.server)}{what}{order}{cancels}"


@check("client.asks", Subject.RECORDING, Asks)
def asks(recording: Recording, parameters: Asks) -> Finding:
    """The client sends the expected requests or goals.

    Judged by what came to a service or an action of the probe: the number, the order, the fields,
    and the times.
    """
    server, asked = parameters.server, recording.asked_of(parameters.server)
    shown, needed = evidence(recording, asked), len(parameters.sequence)
    hint = remedy("other_request")
    pairs = zip(parameters.sequence, asked, strict=False)
    for number, (wanted, request) in enumerate(pairs, start=1):
        seen = f"number {number} that came to {code(server)} has"
        other = unlike(request.fields, wanted, parameters.tolerance)
        stop_if(why_other_fields(seen, "request", request.fields, other, shown, hint))
    if parameters.after_result:
        for before, after in itertools.pairwise(asked):
            stop_if(_why_too_early(before, after, shown))
    if len(asked) < needed:
        stop_if(why_not_asked(recording, server, needed))
    if len(asked) > needed and not parameters.more:
        seen = f"{code(server)} was asked {counted(len(asked), 'time')}, not {needed}"
        return mistaken("too_many_requests", seen, shown)
    if parameters.cancels is not None:
        stop_if(_why_not_canceled(recording, asked[needed - 1], parameters.cancels, shown))
    observed = f"asked {counted(len(asked), 'time')}, first for {brief(asked[0].fields)}"
    return Finding.as_asked(observed, shown)


def _why_too_early(before: Asked, after: Asked, shown: Evidence) -> Finding | None:
    """Why something was asked before what came before it had ended; None if that is right."""
    ended = before.ended_ns is not None and before.ended_ns <= after.asked_ns
    if ended or before.status == "unanswered":
        return None
    seen = f"the next one ({brief(after.fields)}) came before the result of {brief(before.fields)}"
    return mistaken("too_early", seen, shown)


def _why_not_canceled(
    recording: Recording, goal: Asked, span_s: tuple[float, float], shown: Evidence
) -> Finding | None:
    """Why a goal was not asked to cancel in time, or None if it was."""
    shortest_s, longest_s = span_s
    begin_ns, end_ns = goal.accepted_ns or goal.asked_ns, goal.canceled_ns or recording.stop_ns
    if goal.canceled_ns is None:
        seen = "the last goal was never asked to cancel"
    else:
        took_s = (end_ns - begin_ns) / NS
        if shortest_s <= took_s <= longest_s:
            return None
        seen = f"the last goal was asked to cancel {format_duration(took_s)} after it was accepted"
        if took_s < shortest_s:
            return mistaken("not_canceled", seen, shown)
    taken = why_taken(recording, seen, begin_ns, end_ns, longest_s)
    return taken or mistaken("not_canceled", seen, shown)
