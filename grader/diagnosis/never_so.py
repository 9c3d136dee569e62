"""Why what a check waits for never happened in a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from grader.diagnosis.explanation import cause_of, mistaken
from grader.diagnosis.no_answer import NoAnswer
from grader.diagnosis.no_endpoint import SERVICE, offered
from grader.diagnosis.no_messages import why_not_sent, why_silent
from grader.diagnosis.no_node import why_not_node
from grader.diagnosis.process.not_called import ANSWER_S
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.fields import difference_words, unlike
from grader.findings.finding import Evidence, Finding, first_seen, nodes_seen, until_the_end
from grader.findings.value import EXACT
from grader.findings.words import code, counted, listing
from grader.recording.model import Call, Kind, Owner, Recording

# By their ids in lifecycle_msgs/msg/Transition, which has a shutdown from each of three states.
_LABELS = ("create", "configure", "cleanup", "activate", "deactivate", "shutdown")
_TRANSITIONS = dict(enumerate((*_LABELS, "shutdown", "shutdown")))
_OUTCOMES = {True: "succeeded", False: "failed", None: "was not answered"}


def why_never(recording: Recording, seen: str, shown: Evidence | None = None) -> Finding:
    """Why something never happened: the process ended, or it does not get so far."""
    shown = shown or Evidence(moments=(until_the_end(recording),))
    return why_ended(recording, seen) or mistaken("never_happened", seen, shown)


def why_not_in_order(recording: Recording, seen: str) -> Finding:
    """Why several things never happened one after another, or at the same time."""
    shown = Evidence(moments=(until_the_end(recording),))
    return why_ended(recording, seen) or mistaken("never_in_order", seen, shown)


def why_no_such_message(recording: Recording, topic: str, fields: Mapping[str, Any]) -> Finding:
    """Why no message came on a topic, or none with the fields that it should have."""
    messages = recording.carried(topic)
    if not messages:
        is_sent = any(
            one.topic == topic and one.owner is Owner.PROBE and one.kind is Kind.PUBLISHER
            for one in recording.endpoints
        )
        return why_not_sent(recording, topic) if is_sent else why_silent(recording, topic)
    wrong = difference_words(unlike(messages[-1].value, fields, EXACT))
    seen = f"none of {counted(len(messages), 'message')} on {code(topic)}: the last has {wrong}"
    return why_never(recording, seen, Evidence(moments=first_seen(recording, messages)))


def why_never_in_state(recording: Recording, node: str, state: str) -> Finding:
    """Why a lifecycle node was never in a state."""
    missing = why_not_managed(recording, node)
    if missing is not None:
        return missing
    changes = [one for one in recording.calls if one.service == f"{node}/change_state"]
    steps = [f"{transition(one)} {_OUTCOMES[_succeeded(one)]}" for one in changes]
    seen = f"{code(node)} was never {state}" + (f": {listing(steps, 'then')}" if steps else "")
    if any(map(_succeeded, changes)) and not recording.on(f"{node}/transition_event"):
        return Finding.undecided(f"{seen}, but the probe received none of its events")
    failed = [one for one in changes if not _succeeded(one)]
    if not failed:
        return why_never(recording, seen)
    # What failed later, or ended the process, came of the first.
    first = failed[0]
    if first.answered_ns is None:
        silence = NoAnswer(recording, seen, SERVICE, first.service, first.requested_ns, ANSWER_S)
        return cause_of(silence)
    return mistaken("failed_transition", seen, Evidence(moments=(until_the_end(recording),)))


def transition(call: Call) -> str:
    """The label of the transition that a call of ``change_state`` asks for."""
    asked: Mapping[str, Any] = (call.request or {}).get("transition", {})
    number = asked.get("id", 0)
    return asked.get("label") or _TRANSITIONS.get(number, str(number))


def why_not_managed(recording: Recording, node: str) -> Finding | None:
    """Why a lifecycle node is not there, or not one; None if it is."""
    service = f"{node}/get_state"
    missing = why_not_node(recording, node)
    if missing is not None or offered(recording, SERVICE, service):
        return missing
    seen = f"{code(node)} is no lifecycle node: it has no service {code(service)}"
    return mistaken("unmanaged", seen, Evidence(moments=nodes_seen(recording)))


def _succeeded(change: Call) -> bool | None:
    """Whether a transition succeeded, or None if that was not answered."""
    return (change.response or {}).get("success")
