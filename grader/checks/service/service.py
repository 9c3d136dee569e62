"""Checks of services: they are there, they answer as they must, and do so during slow calls."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any, Literal

from pydantic import Field

from grader.checks.check import NamedFields, Parameters, Subject, check
from grader.checks.fields import (
    FieldTolerance,
    brief,
    difference_table,
    difference_words,
    fields_hint,
    has_fields,
    toleranced,
    unlike,
)
from grader.checks.fields import words as fields_words
from grader.checks.finding import Evidence, Finding, Moment, Table
from grader.checks.need import Called, Doubt
from grader.checks.value import EXACT, NoSuchField
from grader.checks.wording import code, codes, counted
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_answer import why_one_cpu, why_taken, why_unanswered
from grader.diagnosis.no_endpoint import SERVICE, is_offered, why_not_met, why_not_offered
from grader.diagnosis.process.process_exit import why_ended
from grader.recording.model import NS, Call, Recording
from grader.spec.name import InterfaceName, TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

# Of the time that one call takes: two answers so close came from calls that ran side by side,
# and two so far apart from calls of which one waited for the other.
_TOGETHER, _APART = 0.5, 0.75


class ServiceExists(Parameters):
    """Parameters of service.exists."""

    doubt = Doubt.ANSWER_MISSED

    service: TopicName = Field(description="Fully qualified service name.")
    type: InterfaceName | None = Field(
        None, description="Interface, such as std_srvs/srv/SetBool; by default any."
    )


@check("service.exists", Subject.RECORDING, ServiceExists)
def exists(recording: Recording, parameters: ServiceExists) -> Finding:
    """The node offers the service.

    Judged by the ROS graph: a service server of the student's was there, with this type.
    """
    return is_offered(recording, SERVICE, parameters.service, parameters.type)


class Responds(Parameters):
    """Parameters of service.responds."""

    needs = (Called(request="request", within="within"),)
    doubt = Doubt.ANSWER_MISSED

    service: TopicName = Field(description="Service that a `call` of the scenario calls.")
    request: dict[str, Any] = Field(
        default_factory=dict,
        description="Which calls are judged: those whose request has these fields; by default all.",
    )
    response: dict[str, Any] = Field(
        default_factory=dict,
        description="Expected fields of the response, nested or by path; others do not matter.",
    )
    contains: dict[str, str] = Field(
        default_factory=dict,
        description="Texts of the response that must hold a word: field -> word, upper and lower "
        "case alike.",
    )
    tolerance: FieldTolerance = EXACT
    within: Duration = Field(
        1.0,
        description="How long the answer may take, by default 1 s.",
        validate_default=False,
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
    asked = f" to {fields_words(parameters.request)}" if parameters.request else ""
    wanted = [f"{path} with “{word}”" for path, word in parameters.contains.items()]
    if parameters.response or not wanted:
        wanted.insert(0, fields_words(parameters.response) if parameters.response else "a response")
    expected = (
        f"the service {code(parameters.service)} answers{asked} with {' and '.join(wanted)} "
        f"within {format_duration(parameters.within)}"
    )
    try:
        calls = judged_calls(recording, parameters.service, parameters.request)
    except NoSuchField as error:
        return _cannot(recording, parameters.service, error, expected)
    if isinstance(calls, Cause):
        return calls.finding(expected)
    late = why_late(recording, parameters.service, calls, parameters.within)
    if late is not None:
        return late.finding(expected)
    try:
        wrong = _first_wrong(recording, calls, parameters)
    except NoSuchField as error:
        return _cannot(recording, parameters.service, error, expected)
    if wrong is not None:
        return wrong.finding(expected)
    slowest_s = max(_took_s(call) for call in calls)
    return Finding.passed(
        expected,
        f"{counted(len(calls), 'call')}, answered within {format_duration(slowest_s)}",
        _evidence(recording, calls),
    )


def _cannot(recording: Recording, service: str, error: NoSuchField, expected: str) -> Finding:
    interface = next(call.type for call in recording.calls if call.service == service)
    return Finding.error(expected, f"the assignment expects what {interface} cannot be: {error}")


def judged_calls(
    recording: Recording, service: str, request: dict[str, Any]
) -> tuple[Call, ...] | Cause:
    """The calls to a service whose request has certain fields, or why there are none.

    Raises:
        NoSuchField: A request cannot have such a field.
    """
    calls = [call for call in recording.calls if call.service == service]
    interface = calls[0].type if calls else None
    cause = why_not_offered(recording, SERVICE, service, interface)
    if cause is not None:
        return cause
    failed = next((call for call in calls if call.error and call.error != "no server"), None)
    if failed is not None:
        return Cause(f"{code(service)} could not be called: {failed.error}", ours=True)
    found = tuple(call for call in calls if has_fields(call.request or {}, request))
    if not found:
        asked = f" with {fields_words(request)}" if request else ""
        return why_ended(recording) or Cause.to_repeat(
            f"the probe sent no call{asked} to {code(service)}"
        )
    lost = next((call for call in found if call.error), None)
    if lost is not None:
        return why_not_met(recording, SERVICE, service, "could not be called", lost.requested_ns)
    return found


def why_late(
    recording: Recording, service: str, calls: tuple[Call, ...], within_s: float
) -> Cause | None:
    """Why one of some calls was not answered in time, or None if all were."""
    unanswered = [call for call in calls if call.answered_ns is None]
    if unanswered:
        first = unanswered[0]
        what = f"{_which(calls, first)} to {code(service)} was never answered"
        return why_unanswered(recording, what, SERVICE, service, first.requested_ns, within_s)
    late = [call for call in calls if _took_s(call) > within_s]
    if not late:
        return None
    worst = max(late, key=_took_s)
    what = (
        f"{_which(calls, worst)} to {code(service)} was answered only after "
        f"{format_duration(_took_s(worst))}"
    )
    taken = why_taken(
        recording, what, worst.requested_ns, worst.answered_ns or recording.stop_ns, within_s
    )
    return taken or Cause(
        what,
        "A service callback must return soon: no time.sleep() and no waiting in it, nor in a "
        "timer or subscription callback that the same executor runs.",
        _evidence(recording, calls),
    )


def _which(calls: tuple[Call, ...], call: Call) -> str:
    number = f"call {calls.index(call) + 1} of {len(calls)}" if len(calls) > 1 else "the call"
    return f"{number} ({brief(call.request)})" if call.request else number


def _took_s(call: Call) -> float:
    return ((call.answered_ns or call.requested_ns) - call.requested_ns) / NS


def _first_wrong(
    recording: Recording, calls: tuple[Call, ...], parameters: Responds
) -> Cause | None:
    for call in calls:
        response = call.response or {}
        found = unlike(response, parameters.response, parameters.tolerance)
        lacking = [
            path
            for path, word in parameters.contains.items()
            if word.casefold() not in str(_text_at(response, path)).casefold()
        ]
        if not found and not lacking:
            continue
        told = [difference_words(found)] if found else []
        told += [
            f"{path} = {_text_at(response, path)!r} without “{parameters.contains[path]}”"
            for path in lacking
        ]
        asked = brief(call.request or {})
        when_s = recording.since_launch_s(call.requested_ns)
        return Cause(
            f"{_which(calls, call)} was answered with {' and '.join(told)}",
            fields_hint("response", response, [*(item.field for item in found), *lacking]),
            Evidence(
                moments=(Moment(f"called with {asked}", when_s),),
                tables=((difference_table(f"Response to {asked}", found),) if found else ()),
            ),
        )
    return None


def _text_at(response: Any, path: str) -> Any:
    here = response
    for step in path.split("."):
        if not isinstance(here, dict) or step not in here:
            raise NoSuchField(f"the response has no field {path!r}")
        here = here[step]
    return here


def _evidence(recording: Recording, calls: tuple[Call, ...]) -> Evidence:
    rows = tuple(
        (
            f"{recording.since_launch_s(call.requested_ns):.2f} s",
            brief(call.request or {}),
            fields_words(call.response) if call.response is not None else "no answer",
            format_duration(_took_s(call)) if call.answered_ns is not None else "",
        )
        for call in calls[:50]
    )
    header = ("called at", "request", "response", "after")
    return Evidence(
        moments=tuple(
            Moment(f"{call.service} called", recording.since_launch_s(call.requested_ns))
            for call in calls[:5]
        ),
        tables=(Table("Calls", header, rows),),
    )


class Concurrent(Parameters):
    """Parameters of service.concurrent."""

    needs = (Called(at_once=2),)
    doubt = Doubt.ANSWER_MISSED

    service: TopicName = Field(
        description="Service that a `call` of the scenario calls with `at_once: 2`."
    )
    takes: Duration = Field(description="How long the service works on one call.")
    calls: Literal["side_by_side", "one_after_another"] = Field(
        "side_by_side", description="How it works on two calls that come at once."
    )


@check("service.concurrent", Subject.RECORDING, Concurrent)
def concurrent(recording: Recording, parameters: Concurrent) -> Finding:
    """A second call during a slow one is worked on as expected.

    Judged by the answers to calls that the probe sent at once: side by side they come together,
    one after another they are as far apart as one call takes.
    """
    how = parameters.calls.replace("_", " ")
    expected = (
        f"{code(parameters.service)} works on calls that come at once {how}, each for "
        f"{format_duration(parameters.takes)}"
    )
    calls = judged_calls(recording, parameters.service, {})
    if isinstance(calls, Cause):
        return calls.finding(expected)
    pairs = _pairs(calls, parameters.takes)
    if not pairs:
        return Finding.error(expected, "the scenario calls the service never twice at once")
    # Time enough for the slower of both, one after the other.
    late = why_late(recording, parameters.service, calls, 2.0 * len(calls) * parameters.takes)
    if late is not None:
        return late.finding(expected)
    for first, second in pairs:
        cause = _why_otherwise(recording, parameters, first, second)
        if cause is not None:
            return cause.finding(expected)
    gap_s = max(_gap_s(*pair) for pair in pairs)
    return Finding.passed(
        expected,
        f"the answers came {format_duration(gap_s)} apart",
        _evidence(recording, calls),
    )


def _pairs(calls: tuple[Call, ...], takes_s: float) -> list[tuple[Call, Call]]:
    """Neighbours of which the second came while the first was worked on."""
    return [
        (first, second)
        for first, second in itertools.pairwise(calls)
        if (second.requested_ns - first.requested_ns) / NS < _TOGETHER * takes_s
    ]


def _gap_s(first: Call, second: Call) -> float:
    return abs((second.answered_ns or 0) - (first.answered_ns or 0)) / NS


def _why_otherwise(
    recording: Recording, parameters: Concurrent, first: Call, second: Call
) -> Cause | None:
    takes_s, gap_s = parameters.takes, _gap_s(first, second)
    standalone_build = gap_s >= _APART * takes_s
    together = gap_s <= _TOGETHER * takes_s
    if together if parameters.calls == "side_by_side" else standalone_build:
        return None
    seen = f"the answers to two calls at once came {format_duration(gap_s)} apart"
    ends = (first.answered_ns or 0, second.answered_ns or 0)
    stolen_s = recording.stolen_s(first.requested_ns, max(ends))
    if (parameters.calls == "side_by_side" and gap_s - stolen_s <= _TOGETHER * takes_s) or (
        not together and not standalone_build
    ):
        return Cause(
            f"{seen}, so it cannot be told how they were worked on",
            ours=stolen_s > 0.0,
            disturbed=stolen_s > 0.0,
            hint=f"Each call should take {format_duration(takes_s)}.",
        )
    evidence = _evidence(recording, (first, second))
    spins = [item.data for item in recording.declared("spin")]
    executors = codes(sorted({str(item.get("executor")) for item in spins}))
    declared = f"; the process declared a {executors}" if spins else ""
    if parameters.calls == "one_after_another":
        return Cause(
            f"{seen}, so both were worked on at the same time{declared}",
            "Give the service a MutuallyExclusiveCallbackGroup, or use rclpy.spin(node).",
            evidence,
        )
    return why_one_cpu(recording, seen) or Cause(
        f"{seen}, so the second call waited until the first was answered{declared}",
        "Spin with a MultiThreadedExecutor, and give the service a ReentrantCallbackGroup: "
        "self.create_service(..., callback_group=ReentrantCallbackGroup()).",
        evidence,
    )
