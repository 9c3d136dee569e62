"""Checks of services: they are there, they answer as they must, and do so during slow calls."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any, Literal

from pydantic import Field

from grader.checks.check import (
    NamedFields,
    Parameters,
    Subject,
    check,
    stop_if,
    stop_if_any,
    toleranced,
)
from grader.checks.need import Act, Doubt, Stimulated
from grader.checks.requests import Offered, is_offered, judged_requests, why_other_fields
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_answer import NoAnswer, why_late
from grader.diagnosis.no_endpoint import SERVICE
from grader.findings.fields import FieldTolerance, brief, unlike, words
from grader.findings.finding import Evidence, Finding, Table, evidence_at, moment
from grader.findings.value import EXACT, value_at
from grader.findings.words import code, codes, counted
from grader.recording.model import NS, Call, Recording
from grader.spec.name import TopicName
from grader.spec.names import Thing
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

# Of the time that one call takes: two answers so close came from calls that ran side by side,
# and two so far apart from calls of which one waited for the other.
_TOGETHER, _APART = 0.5, 0.75


class ServiceExists(Offered):
    """Parameters of service.exists."""

    kind, thing, called = SERVICE, Thing.SERVICE, "{self.service}"

    service: TopicName = Field(description="Fully qualified service name.")


@check("service.exists", Subject.RECORDING, ServiceExists)
def exists(recording: Recording, parameters: ServiceExists) -> Finding:
    """The node offers the service.

    Judged by the ROS graph: the student's node had a service server of this type.
    """
    return is_offered(recording, parameters)


class Responds(Parameters):
    """Parameters of service.responds."""

    needs = (Stimulated(Act.CALL, "service", fields="request", within="within"),)
    doubt = Doubt.ANSWER_MISSED

    service: TopicName = Field(description="Service that a `call` of the scenario calls.")
    request: dict[str, Any] = Field(
        default_factory=dict,
        description="Judge only calls whose request has these fields; by default all.",
    )
    response: dict[str, Any] = Field(
        default_factory=dict,
        description="Expected fields of the response, nested or by path; others do not matter.",
    )
    contains: dict[str, str] = Field(
        default_factory=dict,
        description="Fields of the response that must contain a word: field -> word. Upper and "
        "lower case do not matter.",
    )
    tolerance: FieldTolerance = EXACT
    within: Duration = Field(1.0, description="Longest time for an answer.")

    def _asked(self) -> str:
        asked = f" to {words(self.request)}" if self.request else ""
        wanted = [words(self.response)] if self.response else []
        wanted += [f"{path} that contains “{word}”" for path, word in self.contains.items()]
        return (
            f"the service {code(self.service)} answers{asked} with "
            f"{' and '.join(wanted) or 'a response'} within {format_duration(self.within)}"
        )

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields of the request and of the response."""
        yield NamedFields(("request",), self.service, self.request)
        yield from toleranced("response", self.service, self.response, self.tolerance, part=1)
        for path in self.contains:
            yield NamedFields(("contains", path), self.service, {path: ""}, part=1)


@check("service.responds", Subject.RECORDING, Responds)
def responds(recording: Recording, parameters: Responds) -> Finding:
    """The service answers as expected, in time.

    Judged by the calls that the probe sent: every one must be answered in time, with the
    expected fields. A node answers only while its executor spins.
    """
    calls = judged_calls(recording, parameters.service, parameters.request)
    stop_if(why_slow(recording, calls, parameters.within))
    for call in calls:
        stop_if(_why_other_response(recording, calls, call, parameters))
    slowest_s = max(map(_took_s, calls))
    observed = f"{counted(len(calls), 'call')}, answered within {format_duration(slowest_s)}"
    return Finding.as_asked(observed, _evidence(recording, calls))


def judged_calls(
    recording: Recording, service: str, request: dict[str, Any] | None = None
) -> tuple[Call, ...]:
    """The calls to a service whose request has certain fields; ends the check if there is none."""
    return judged_requests(recording, SERVICE, service, recording.calls, request or {})


def why_slow(recording: Recording, calls: tuple[Call, ...], within_s: float) -> Finding | None:
    """Why one of some calls was not answered in time, or None if all were."""
    worst = max(calls, key=_took_s)
    seen = f"{_which(calls, worst)} to {code(worst.service)} was not answered"
    silence = NoAnswer(recording, seen, SERVICE, worst.service, worst.requested_ns, within_s)
    return why_late(silence, worst.answered_ns, "slow_callback", _evidence(recording, calls))


def _which(calls: tuple[Call, ...], call: Call) -> str:
    number = f"call {calls.index(call) + 1} of {len(calls)}" if len(calls) > 1 else "the call"
    return f"{number} ({brief(call.request)})" if call.request else number


def _took_s(call: Call) -> float:
    return math.inf if call.answered_ns is None else (call.answered_ns - call.requested_ns) / NS


def _why_other_response(
    recording: Recording, calls: tuple[Call, ...], call: Call, parameters: Responds
) -> Finding | None:
    seen = f"{_which(calls, call)} was answered with"
    called, response = f"called with {brief(call.request or {})}", call.response or {}
    shown = evidence_at(recording, called, call.requested_ns)
    other = unlike(response, parameters.response, parameters.tolerance)
    wrong = why_other_fields(seen, "response", response, other, shown)
    if wrong is not None:
        return wrong
    lacking = [
        f"{path} = {value_at(response, path)!r} without “{word}”"
        for path, word in parameters.contains.items()
        if word.casefold() not in str(value_at(response, path)).casefold()
    ]
    if not lacking:
        return None
    return mistaken("other_text", f"{seen} {' and '.join(lacking)}", shown)


def _evidence(recording: Recording, calls: Sequence[Call]) -> Evidence:
    rows = tuple(
        (
            f"{recording.since_launch_s(call.requested_ns):.2f} s",
            brief(call.request or {}),
            words(call.response) if call.response is not None else "no answer",
            format_duration(_took_s(call)) if call.answered_ns is not None else "",
        )
        for call in calls[:50]
    )
    moments = [moment(recording, f"{one.service} called", one.requested_ns) for one in calls[:5]]
    table = Table("Calls", ("called at", "request", "response", "after"), rows)
    return Evidence(moments=tuple(moments), tables=(table,))


class Concurrent(Parameters):
    """Parameters of service.concurrent."""

    needs = (Stimulated(Act.CALL, "service", having="at_once: 2"),)
    doubt = Doubt.ANSWER_MISSED

    service: TopicName = Field(
        description="Service that a `call` of the scenario calls with `at_once: 2`."
    )
    takes: Duration = Field(description="Processing time of one call.")
    calls: Literal["side_by_side", "one_after_another"] = Field(
        "side_by_side", description="How it processes two calls that come at once."
    )

    def _asked(self) -> str:
        return (
            f"{code(self.service)} processes calls {self.calls.replace('_', ' ')} if they come at "
            f"once, each in {format_duration(self.takes)}"
        )


@check("service.concurrent", Subject.RECORDING, Concurrent, concept="executors")
def concurrent(recording: Recording, parameters: Concurrent) -> Finding:
    """A second call during a slow call is processed as expected.

    Judged by the answers to calls that the probe sent at once. Parallel calls are answered
    together. Calls one after another are answered one processing time apart.
    """
    calls = judged_calls(recording, parameters.service)
    pairs = [
        (first, second)
        for first, second in itertools.pairwise(calls)
        if (second.requested_ns - first.requested_ns) / NS < _TOGETHER * parameters.takes
    ]
    if not pairs:
        text = "the scenario never calls the service twice at once"
        return Finding.ours(text)
    # Time enough for the slower of both, one after the other.
    stop_if(why_slow(recording, calls, 2.0 * len(calls) * parameters.takes))
    stop_if_any(_why_other_order(recording, parameters, pair) for pair in pairs)
    observed = f"the answers came {format_duration(max(map(_gap_s, pairs)))} apart"
    return Finding.as_asked(observed, _evidence(recording, calls))


def _gap_s(pair: tuple[Call, Call]) -> float:
    return abs((pair[1].answered_ns or 0) - (pair[0].answered_ns or 0)) / NS


def _why_other_order(
    recording: Recording, parameters: Concurrent, pair: tuple[Call, Call]
) -> Finding | None:
    gap_s, takes_s = _gap_s(pair), parameters.takes
    side_by_side = parameters.calls == "side_by_side"
    together, far_apart = gap_s <= _TOGETHER * takes_s, gap_s >= _APART * takes_s
    if (side_by_side and together) or (far_apart and not side_by_side):
        return None
    seen = f"the answers to two calls at once came {format_duration(gap_s)} apart"
    ended_ns = max(call.answered_ns or 0 for call in pair)
    stolen_s = recording.stolen_s(pair[0].requested_ns, ended_ns)
    # The machine may have held up the second answer, or the first one.
    if side_by_side:
        in_doubt = gap_s - stolen_s <= _TOGETHER * takes_s
    else:
        in_doubt = gap_s + stolen_s >= _APART * takes_s
    if in_doubt:
        return Finding.held_up(seen, stolen_s)
    shown = _evidence(recording, pair)
    if not together and not far_apart:
        seen += ": neither together nor one processing time apart"
        return mistaken("other_duration", seen, shown, takes=format_duration(takes_s))
    executors = sorted({str(item.data.get("executor")) for item in recording.declared("spin")})
    declared = f"; the process declared a {codes(executors)}" if executors else ""
    if side_by_side:
        seen += f", so the second call waited until the first was answered{declared}"
        return mistaken("one_after_another", seen, shown)
    seen += f", so both were processed at the same time{declared}"
    return mistaken("side_by_side", seen, shown)
