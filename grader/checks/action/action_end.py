"""Checks of actions whose goals do not come to their own end: canceled, or preempted."""

from __future__ import annotations

from pydantic import Field

from grader.checks.action.action import OfGoals, cannot, type_of
from grader.checks.action.goals import (
    evidence,
    judged_goals,
    why_rejected,
    why_server_gone,
)
from grader.checks.check import Subject, check
from grader.checks.fields import words as fields_words
from grader.checks.finding import Finding
from grader.checks.need import GoalSent
from grader.checks.value import NoSuchField
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_answer import why_one_cpu, why_raised, why_taken, why_unanswered
from grader.diagnosis.no_endpoint import ACTION
from grader.diagnosis.process.process_exit import why_ended
from grader.recording.interaction import Goal
from grader.recording.model import NS, Recording
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

# Share of the time from the request to cancel until the end of the goal.
_AT_THE_END = 0.8
_TWO_THREADS = (
    "Spin with a MultiThreadedExecutor, and give the ActionServer a ReentrantCallbackGroup."
)


class Cancels(OfGoals):
    """Parameters of action.cancels."""

    needs = (GoalSent(having="cancel_after"),)

    within: Duration = Field(
        1.0,
        description="How soon after it was asked the goal must be canceled, by default 1 s.",
        validate_default=False,
    )


@check("action.cancels", Subject.RECORDING, Cancels)
def cancels(recording: Recording, parameters: Cancels) -> Finding:
    """A goal can be canceled while it is worked on.

    Judged by the goals that the probe asked to cancel (`cancel_after`): the server agrees, and
    the goal ends as canceled in time.
    """
    expected = f"{parameters.words} is canceled within {format_duration(parameters.within)}"
    try:
        goals = judged_goals(
            recording, parameters.action, parameters.goal, lambda g: g.cancel_after_s is not None
        )
    except NoSuchField as error:
        return cannot(type_of(recording, parameters.action), error, expected)
    if isinstance(goals, Cause):
        return goals.finding(expected)
    for goal in goals:
        cause = why_rejected(recording, goal) or _why_not_canceled(
            recording, goal, parameters.within
        )
        if cause is not None:
            return cause.finding(expected)
    return Finding.passed(
        expected,
        f"canceled {format_duration(_end_s(goals[0]))} after it was asked",
        evidence(recording, goals[0]),
    )


def _end_s(goal: Goal) -> float:
    return ((goal.result_ns or 0) - (goal.canceled_ns or 0)) / NS


def _why_not_canceled(recording: Recording, goal: Goal, within_s: float) -> Cause | None:
    shown = evidence(recording, goal)
    if goal.canceled_ns is None:
        return _never_asked(recording, goal)
    asked_ns = goal.canceled_ns
    if goal.status == "canceled" and _end_s(goal) <= within_s:
        return None
    if goal.cancel_accepted is False and not _answered_too_late(goal):
        return Cause(
            "the server refused to cancel the goal",
            "The ActionServer's cancel_callback decides: it returns CancelResponse.ACCEPT. Without "
            "one rclpy refuses.",
            shown,
        )
    if goal.cancel_answered_ns is None or goal.status != "canceled":
        return _why_other_end(recording, goal, within_s)
    seen = f"the goal was canceled only {format_duration(_end_s(goal))} after it was asked"
    taken = why_taken(recording, seen, asked_ns, goal.result_ns or 0, within_s)
    return taken or Cause(
        seen, "Look at goal_handle.is_cancel_requested in every round of the loop.", shown
    )


def _never_asked(recording: Recording, goal: Goal) -> Cause:
    """The goal was not asked to cancel: it ended too early, or the run did."""
    if goal.result_ns is None:
        late = Cause.to_repeat("the run ended before the goal was asked to cancel")
        return why_ended(recording) or late
    lasted_s = (goal.result_ns - (goal.answered_ns or goal.sent_ns)) / NS
    if lasted_s > (goal.cancel_after_s or 0.0):
        return Cause.to_repeat("the probe was too late to ask for it")
    return _ended_alone(recording, goal, f"the goal {goal.status} {format_duration(lasted_s)}")


def _ended_alone(recording: Recording, goal: Goal, seen: str) -> Cause:
    """The goal came to an end before anybody could end it."""
    what = f"{seen} after it was accepted, before it was to be ended"
    return why_raised(recording, what, goal.sent_ns) or Cause(
        what,
        "The execute callback returns too early: it must work on the goal step by step, with a "
        "pause between.",
        evidence(recording, goal),
    )


def _answered_too_late(goal: Goal) -> bool:
    """Whether the server took in that it should cancel only when the goal ended."""
    if goal.result_ns is None:
        return False
    if goal.cancel_answered_ns is None:
        return True
    asked_ns = goal.canceled_ns or 0
    # An executor that was busy until then answers right before it tells the result.
    waited = (goal.cancel_answered_ns - asked_ns) / max(goal.result_ns - asked_ns, 1)
    return waited >= _AT_THE_END


def _why_other_end(recording: Recording, goal: Goal, within_s: float) -> Cause:
    """It was not canceled: it ended otherwise, or never."""
    shown = evidence(recording, goal)
    asked_ns = goal.canceled_ns or 0
    if goal.result_ns is None:
        seen = "the goal was asked to cancel, but neither canceled nor ended"
        gone = why_server_gone(recording, goal, seen)
        if gone is None and goal.cancel_answered_ns is None:
            untold = f"{seen}: the server did not take that in"
            busy = f"{untold}; its executor cannot while the execute callback runs"
            return why_one_cpu(recording, untold) or why_unanswered(
                recording,
                untold,
                ACTION,
                goal.action,
                asked_ns,
                within_s,
                Cause(busy, _TWO_THREADS),
            )
        gone = gone or why_taken(recording, seen, asked_ns, recording.stop_ns, within_s)
        return gone or Cause(
            f"{seen}: it goes on",
            "In the loop of the execute callback: if goal_handle.is_cancel_requested, call "
            "goal_handle.canceled() and return the result.",
            shown,
        )
    raised = why_raised(
        recording, f"the goal {goal.status} instead of being canceled", goal.sent_ns
    )
    if raised is not None:
        return raised
    if _answered_too_late(goal):
        untold = f"the goal {goal.status} before the server took in that it should cancel"
        return why_one_cpu(recording, untold) or Cause(
            f"{untold}: its executor cannot while the execute callback runs", _TWO_THREADS, shown
        )
    return Cause(
        f"the server agreed to cancel, but the goal {goal.status}",
        "In the loop of the execute callback: if goal_handle.is_cancel_requested, call "
        "goal_handle.canceled() and return the result.",
        shown,
    )


class Preempts(OfGoals):
    """Parameters of action.preempts."""

    needs = (GoalSent(having="preempt"),)

    within: Duration = Field(
        1.0,
        description="How soon after the new goal the old one must end, by default 1 s.",
        validate_default=False,
    )


@check("action.preempts", Subject.RECORDING, Preempts)
def preempts(recording: Recording, parameters: Preempts) -> Finding:
    """A new goal ends the one that is worked on.

    Judged by the goals that the probe sent while another one was active (`preempt: true`): the
    new one is accepted, and the old one ends in time, canceled or aborted, without success.
    """
    expected = (
        f"{parameters.words} ends the goal before it within {format_duration(parameters.within)}"
    )
    try:
        goals = judged_goals(recording, parameters.action, parameters.goal, lambda g: g.preempts)
    except NoSuchField as error:
        return cannot(type_of(recording, parameters.action), error, expected)
    if isinstance(goals, Cause):
        return goals.finding(expected)
    sent = [goal for goal in recording.goals if goal.action == parameters.action]
    for goal in goals:
        before = sent[sent.index(goal) - 1] if sent.index(goal) else None
        cause = (
            Cause("there is no goal before it that it could end", ours=True)
            if before is None
            else why_rejected(recording, before)
            or why_rejected(recording, goal)
            or _why_goes_on(recording, before, goal, parameters)
        )
        if cause is not None:
            return cause.finding(expected)
    return Finding.passed(expected, "the old goal ended", evidence(recording, goals[0]))


def _why_goes_on(
    recording: Recording, before: Goal, goal: Goal, parameters: Preempts
) -> Cause | None:
    shown = evidence(recording, before)
    hint = (
        "Keep the current goal handle, and call its abort() when a new goal comes "
        "(handle_accepted_callback); look at is_active in every round of the loop."
    )
    if before.result_ns is not None and before.result_ns < goal.sent_ns:
        late_s = (goal.sent_ns - before.result_ns) / NS
        if recording.stolen_s(before.sent_ns, goal.sent_ns) >= late_s:
            return Cause.to_repeat("the old goal had ended before the new one was sent")
        lasted_s = (before.result_ns - (before.answered_ns or before.sent_ns)) / NS
        return _ended_alone(
            recording, before, f"the old goal {before.status} {format_duration(lasted_s)}"
        )
    which = f"the old goal ({fields_words(before.goal)})"
    if before.result_ns is None:
        seen = f"{which} was still worked on at the end"
        gone = why_server_gone(recording, before, seen)
        taken = why_taken(recording, seen, goal.sent_ns, recording.stop_ns, parameters.within)
        return gone or taken or Cause(seen, hint, shown)
    took_s = (before.result_ns - goal.sent_ns) / NS
    if before.status == "succeeded":
        return Cause(f"{which} was worked on to its end, and succeeded", hint, shown)
    if took_s <= parameters.within:
        return None
    seen = f"{which} ended only {format_duration(took_s)} after the new one was sent"
    taken = why_taken(recording, seen, goal.sent_ns, before.result_ns, parameters.within)
    return taken or Cause(seen, hint, shown)
