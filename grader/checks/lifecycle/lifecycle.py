"""The check of the states of a lifecycle node."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Act, Doubt, Stimulated
from grader.checks.requests import timeline
from grader.checks.service.service import judged_calls, why_slow
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.contact import why_touched
from grader.diagnosis.never_so import transition, why_not_managed
from grader.diagnosis.process.not_called import ANSWER_S
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.finding import Evidence, Finding
from grader.findings.words import code, counted, listing
from grader.recording.model import Call, Recording
from grader.spec.name import QualifiedNodeName


class State(Parameters):
    """Parameters of lifecycle.state."""

    needs = (Stimulated(Act.CALL, "node", suffix="/get_state"),)
    doubt = Doubt.ANSWER_MISSED

    node: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    states: tuple[str, ...] = Field(
        min_length=1,
        description="State at each call of the scenario to the node's `get_state`, in order: "
        "`unconfigured`, `inactive`, `active`, `finalized`.",
    )

    def _asked(self) -> str:
        return f"the states of {code(self.node)}: {listing(self.states, 'then')}"


@check("lifecycle.state", Subject.RECORDING, State)
def state(recording: Recording, parameters: State) -> Finding:
    """The lifecycle node goes through the expected states.

    Judged by the node's answers to the calls of `get_state` in the scenario
    (`lifecycle_msgs/srv/GetState`), between those of `change_state`. If the machine that grades
    lacks the package lifecycle_msgs, the check ends as an error.
    """
    node, service = parameters.node, f"{parameters.node}/get_state"
    stop_if(why_not_managed(recording, node))
    calls = judged_calls(recording, service)
    stop_if(why_slow(recording, calls, ANSWER_S))
    states = [_state(call) for call in calls]
    if len(states) < len(parameters.states):
        # A contact ends the run, too.
        stop_if(why_ended(recording) or why_touched(recording))
        text = f"the scenario asks for the state only {counted(len(states), 'time')}"
        return Finding.ours(text)
    changes = [call for call in recording.calls if call.service == f"{node}/change_state"]
    steps = [(call.requested_ns, f"is {label}") for call, label in zip(calls, states, strict=True)]
    steps += [(call.requested_ns, f"transition {transition(call)}") for call in changes]
    shown = timeline(recording, f"The lifecycle of {node}", steps)
    for number, wanted in enumerate(parameters.states):
        if states[number] != wanted:
            observed = f"at call {number + 1} of get_state it is {states[number]}"
            asked_ns = calls[number].requested_ns
            before = [change for change in changes if change.requested_ns < asked_ns]
            return _otherwise(observed, before[-1] if before else None, shown)
    return Finding.as_asked(listing(states, "then"), shown)


def _otherwise(observed: str, last_change: Call | None, shown: Evidence) -> Finding:
    """The finding for another state, after the last transition succeeded or failed."""
    if last_change is None or (last_change.response or {}).get("success") is True:
        return mistaken("own_transition", observed, shown)
    observed += f", after the transition {transition(last_change)} failed"
    return mistaken("failed_transition", observed, shown)


def _state(call: Call) -> str:
    """The label, or else the number, of the state in an answer."""
    found = (call.response or {}).get("current_state", {})
    return str(found.get("label") or found.get("id", ""))
