"""The check of the states of a lifecycle node."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment, Table
from grader.checks.first_seen import nodes_seen
from grader.checks.need import Called, Doubt
from grader.checks.service.service import judged_calls, why_late
from grader.checks.wording import code, listing
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_node import why_not_node
from grader.recording.model import Call, Recording
from grader.spec.name import QualifiedNodeName

_ANSWER_S = 1.0


class State(Parameters):
    """Parameters of lifecycle.state."""

    needs = (Called("node", suffix="/get_state", count="states"),)
    doubt = Doubt.ANSWER_MISSED

    node: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    states: tuple[str, ...] = Field(
        min_length=1,
        description="State at each call of the scenario to the node's `get_state`, in order: "
        "`unconfigured`, `inactive`, `active`, `finalized`.",
    )


@check("lifecycle.state", Subject.RECORDING, State)
def state(recording: Recording, parameters: State) -> Finding:
    """The lifecycle node goes through the expected states.

    Judged by the node's own answers to the calls of `get_state` that the scenario makes
    (`lifecycle_msgs/srv/GetState`), between those of `change_state`.
    Without the package lifecycle_msgs on the machine that grades, it is an error.
    """
    node = parameters.node
    expected = f"the states of {code(node)}: {listing(parameters.states, 'then')}"
    cause = why_not_node(recording, node)
    if cause is not None:
        return cause.finding(expected)
    service = f"{node}/get_state"
    calls = judged_calls(recording, service, {})
    if isinstance(calls, Cause):
        if not calls.ours and not any(item.name == service for item in recording.services):
            calls = Cause(
                f"{code(node)} is no lifecycle node: it has no service {code(service)}",
                "Inherit from rclpy.lifecycle.LifecycleNode instead of Node.",
                Evidence(moments=nodes_seen(recording)),
            )
        return calls.finding(expected)
    late = why_late(recording, service, calls, _ANSWER_S)
    if late is not None:
        return late.finding(expected)
    seen = [_label(call) for call in calls]
    if len(seen) < len(parameters.states):
        return Finding.error(expected, f"the scenario asks for the state only {len(seen)} times")
    wrong = next(
        (
            n
            for n, pair in enumerate(zip(parameters.states, seen, strict=False))
            if len(set(pair)) > 1
        ),
        None,
    )
    shown = _evidence(recording, node, calls)
    if wrong is None:
        return Finding.passed(expected, listing(seen, "then"), shown)
    refused = _refused(recording, node, calls[wrong])
    observed = f"at the call {wrong + 1} of get_state it is {seen[wrong]}"
    return Finding.failed(
        expected,
        f"{observed}, after the transition {refused} failed" if refused else observed,
        "The callback of a transition (on_configure, on_activate, ...) must return "
        "TransitionCallbackReturn.SUCCESS, and call super() where it activates publishers."
        if refused
        else "Does the node begin unconfigured, and change no state by itself?",
        shown,
    )


def _label(call: Call) -> str:
    state: Any = (call.response or {}).get("current_state")
    return str(state.get("label", "")) if isinstance(state, dict) else ""


def _refused(recording: Recording, node: str, before: Call) -> str:
    """The last transition before a call that did not succeed."""
    for call in reversed(_changes(recording, node)):
        if call.requested_ns < before.requested_ns:
            good = (call.response or {}).get("success") is True
            return "" if good else _transition(call)
    return ""


def _changes(recording: Recording, node: str) -> list[Call]:
    return [call for call in recording.calls if call.service == f"{node}/change_state"]


def _transition(call: Call) -> str:
    asked: Any = (call.request or {}).get("transition")
    if not isinstance(asked, dict):
        return "?"
    return str(asked.get("label") or asked.get("id"))


def _evidence(recording: Recording, node: str, calls: tuple[Call, ...]) -> Evidence:
    steps = [(call.requested_ns, f"is {_label(call)}") for call in calls]
    steps += [
        (call.requested_ns, f"transition {_transition(call)}") for call in _changes(recording, node)
    ]
    steps.sort(key=lambda step: step[0])
    rows = tuple((f"{recording.since_launch_s(at_ns):.2f} s", said) for at_ns, said in steps)
    return Evidence(
        moments=tuple(Moment(said, recording.since_launch_s(at_ns)) for at_ns, said in steps[:8]),
        tables=(Table(f"The lifecycle of {node}", ("since launch", ""), rows[:50]),),
    )
