"""Goals that the probe sent: which of them a check is about, and why there is none to judge."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from grader.checks.fields import has_fields
from grader.checks.fields import words as fields_words
from grader.checks.finding import Evidence, Moment, Table
from grader.checks.wording import code
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_destroyed
from grader.diagnosis.no_answer import why_gone, why_taken, why_unanswered
from grader.diagnosis.no_endpoint import ACTION, offered, why_not_met, why_not_offered
from grader.diagnosis.process.process_exit import why_ended
from grader.recording.interaction import Goal
from grader.recording.model import NS, Recording
from grader.spec.unit import format_duration

_MOST_ROWS = 50
ANSWER_S = 1.0
"""How soon a server must say whether it accepts a goal: its callback only decides."""


def judged_goals(
    recording: Recording,
    action: str,
    fields: Mapping[str, Any],
    wanted: Callable[[Goal], bool] = lambda _: True,
) -> tuple[Goal, ...] | Cause:
    """Goals with certain fields, each answered by the server, or why there are none.

    Raises:
        NoSuchField: A goal cannot have such a field.
    """
    goals = [goal for goal in recording.goals if goal.action == action]
    interface = goals[0].type if goals else None
    cause = why_not_offered(recording, ACTION, action, interface)
    if cause is not None:
        return cause
    failed = next((goal for goal in goals if goal.error and goal.error != "no server"), None)
    if failed is not None:
        return Cause(f"no goal could be sent to {code(action)}: {failed.error}", ours=True)
    found = tuple(goal for goal in goals if has_fields(goal.goal, fields) and wanted(goal))
    if not found:
        ended = why_ended(recording)
        if ended is not None:
            return ended
        asked = f" with {fields_words(fields)}" if fields else ""
        if any(has_fields(goal.goal, fields) for goal in goals):
            return Cause(
                f"no goal{asked} that was sent to {code(action)} is one that this check judges",
                "action.cancels judges goals with cancel_after, action.preempts those with "
                "preempt, and the other checks those that come to their own end.",
                ours=True,
            )
        return Cause.to_repeat(f"the probe sent no goal{asked} to {code(action)}")
    for goal in found:
        if goal.error:
            return why_not_met(recording, ACTION, action, "could not be sent a goal", goal.sent_ns)
        if goal.accepted is None:
            what = f"the goal ({fields_words(goal.goal)}) was neither accepted nor rejected"
            return why_unanswered(recording, what, ACTION, action, goal.sent_ns, ANSWER_S)
    return found


def why_rejected(recording: Recording, goal: Goal) -> Cause | None:
    """Why a goal that should have been accepted was not, or None if it was."""
    if goal.accepted is not False:
        return None
    return Cause(
        f"the goal ({fields_words(goal.goal)}) was rejected",
        "A goal_callback must return GoalResponse.ACCEPT for a goal that is right; without one "
        "every goal is accepted.",
        evidence(recording, goal),
    )


def why_no_result(recording: Recording, goal: Goal, within_s: float) -> Cause | None:
    """Why a goal that was accepted had no result in time, or None if it had one."""
    if goal.result_ns is None:
        what = f"the goal ({fields_words(goal.goal)}) was accepted, but never had a result"
        return why_unanswered(recording, what, ACTION, goal.action, goal.sent_ns, within_s)
    took_s = (goal.result_ns - goal.sent_ns) / NS
    if took_s <= within_s:
        return None
    what = f"the result came only {format_duration(took_s)} after the goal"
    return why_taken(recording, what, goal.sent_ns, goal.result_ns, within_s) or Cause(
        what, "Look for a sleep that is too long.", evidence(recording, goal)
    )


def why_server_gone(recording: Recording, goal: Goal, what: str) -> Cause | None:
    """Why the server that worked on a goal is not there any more, or None if it is."""
    own = offered(recording, ACTION, goal.action)
    return why_gone(recording, what, own[-1].node) or why_destroyed(
        recording, what, f"the action {code(goal.action)}", own
    )


def evidence(recording: Recording, goal: Goal) -> Evidence:
    """What became of a goal, step by step."""
    steps: list[tuple[int, str]] = [(goal.sent_ns, f"goal sent: {fields_words(goal.goal)}")]
    if goal.answered_ns is not None:
        steps.append((goal.answered_ns, "accepted" if goal.accepted else "rejected"))
    steps += [(item.time_ns, f"feedback: {fields_words(item.value)}") for item in goal.feedback]
    steps += [(time_ns, f"status: {status}") for time_ns, status in goal.statuses]
    if goal.canceled_ns is not None:
        steps.append((goal.canceled_ns, "asked to cancel"))
    if goal.cancel_answered_ns is not None:
        agreed = "accepted" if goal.cancel_accepted else "refused"
        steps.append((goal.cancel_answered_ns, f"cancel {agreed}"))
    if goal.result_ns is not None:
        steps.append((goal.result_ns, f"{goal.status}: {fields_words(goal.result or {})}"))
    steps.sort(key=lambda step: step[0])
    rows = tuple((f"{recording.since_launch_s(at_ns):.2f} s", said) for at_ns, said in steps)
    moments = [
        Moment(said.partition(":")[0], recording.since_launch_s(at_ns))
        for at_ns, said in steps
        if not said.startswith("feedback")
    ]
    table = Table(f"A goal of {goal.action}", ("since launch", "what happened"), rows[:_MOST_ROWS])
    return Evidence(moments=tuple(moments[:8]), tables=(table,))
