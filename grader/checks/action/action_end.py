"""Checks of actions whose goals do not come to their own end: canceled, or preempted."""

from __future__ import annotations

from pydantic import Field

from grader.checks.action.action import (
    OfGoals,
    answered_goals,
    evidence,
    the_goal,
    why_rejected,
)
from grader.checks.check import Subject, check, stop_if
from grader.checks.finding import Finding
from grader.checks.need import GoalSent
from grader.checks.requests import why_late
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_answer import why_one_cpu, why_raised, why_taken, why_unanswered
from grader.diagnosis.no_server import ACTION
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
_CANCELED = (
    "In the loop of the execute callback: if goal_handle.is_cancel_requested, call "
    "goal_handle.canceled() and return the result."
)


class Cancels(OfGoals):
    """Parameters of action.cancels."""

    needs = (GoalSent(having="cancel_after"),)

    within: Duration = Field(
        1.0,
        description="How soon after it was asked the goal must be canceled, by default 1 s.",
        validate_default=False,
    )

    @property
    def asked_for(self) -> str:
        """The end in words."""
        return f"{self.words} is canceled within {format_duration(self.within)}"


@check("action.cancels", Subject.RECORDING, Cancels)
def cancels(recording: Recording, parameters: Cancels) -> Finding:
    """A goal can be canceled while it is worked on.

    Judged by the goals that the probe asked to cancel (`cancel_after`): the server agrees, and
    the goal ends as canceled in time.
    """
    goals = answered_goals(recording, parameters, lambda goal: goal.cancel_after_s is not None)
    for goal in goals:
        stop_if(why_rejected(recording, goal))
        stop_if(_why_not_asked(recording, goal))
        stop_if(_why_not_canceled(recording, goal, parameters.within))
    took_s = ((goals[0].result_ns or 0) - (goals[0].canceled_ns or 0)) / NS
    return Finding.passed(
        parameters.asked_for,
        f"canceled {format_duration(took_s)} after it was asked",
        evidence(recording, goals[0]),
    )


def _why_not_asked(recording: Recording, goal: Goal) -> Cause | None:
    """Why the goal was not asked to cancel: it ended too early, or the run did."""
    if goal.canceled_ns is not None:
        return None
    if goal.result_ns is None:
        late = Cause.to_repeat("the run ended before the goal was asked to cancel")
        return why_ended(recording) or late
    lasted_s = (goal.result_ns - (goal.answered_ns or goal.sent_ns)) / NS
    if lasted_s > (goal.cancel_after_s or 0.0):
        return Cause.to_repeat("the probe was too late to ask for it")
    return _ended_alone(recording, goal)


def _why_not_canceled(recording: Recording, goal: Goal, within_s: float) -> Cause | None:
    """Why a goal that was asked to cancel was not canceled in time: refused, too late, or never."""
    asked_ns, shown = goal.canceled_ns or 0, evidence(recording, goal)
    if goal.status == "canceled" and goal.result_ns is not None:
        seen = f"{the_goal(goal)} was not canceled"
        hint = "Look at goal_handle.is_cancel_requested in every round of the loop."
        server, end_ns = goal.action, goal.result_ns
        return why_late(recording, ACTION, server, asked_ns, end_ns, within_s, seen, hint, shown)
    if goal.cancel_accepted is False and not _answered_too_late(goal):
        return Cause(
            "the server refused to cancel the goal",
            "The ActionServer's cancel_callback decides: it returns CancelResponse.ACCEPT. Without "
            "one rclpy refuses.",
            shown,
        )
    if goal.result_ns is None:
        seen = "the goal was asked to cancel, but neither canceled nor ended"
    else:
        seen = f"the goal {goal.status} instead of being canceled"
    cause, one_cpu = Cause(f"{seen}: the execute callback goes on", _CANCELED, shown), None
    is_untaken = goal.cancel_answered_ns is None or _answered_too_late(goal)
    if is_untaken:
        seen += ": the server did not take in the request to cancel"
        busy = f"{seen}; its executor cannot while the execute callback runs"
        cause, one_cpu = Cause(busy, _TWO_THREADS, shown), why_one_cpu(recording, seen)
    if goal.result_ns is not None:
        return why_raised(recording, seen, goal.sent_ns) or one_cpu or cause
    if is_untaken:
        return one_cpu or why_unanswered(
            recording, seen, ACTION, goal.action, asked_ns, within_s, cause
        )
    return _why_no_end(recording, seen, asked_ns, within_s) or cause


def _why_no_end(recording: Recording, seen: str, asked_ns: int, within_s: float) -> Cause | None:
    """Why a goal never ended, if its process ended or had no time."""
    taken = why_taken(recording, seen, asked_ns, recording.stop_ns, within_s)
    return why_ended(recording, seen) or taken


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


def _ended_alone(recording: Recording, goal: Goal) -> Cause:
    """A goal came to an end before the probe could end it."""
    lasted_s = ((goal.result_ns or 0) - (goal.answered_ns or goal.sent_ns)) / NS
    what = (
        f"{the_goal(goal)} {goal.status} {format_duration(lasted_s)} after it was accepted, before "
        "it was to be ended"
    )
    return why_raised(recording, what, goal.sent_ns) or Cause(
        what,
        "The execute callback returns too early: it must work on the goal step by step, with a "
        "pause between.",
        evidence(recording, goal),
    )


class Preempts(OfGoals):
    """Parameters of action.preempts."""

    needs = (GoalSent(having="preempt"),)

    within: Duration = Field(
        1.0,
        description="How soon after the new goal the old one must end, by default 1 s.",
        validate_default=False,
    )

    @property
    def asked_for(self) -> str:
        """The end of the old goal in words."""
        return f"{self.words} ends the goal before it within {format_duration(self.within)}"


@check("action.preempts", Subject.RECORDING, Preempts)
def preempts(recording: Recording, parameters: Preempts) -> Finding:
    """A new goal ends the one that is worked on.

    Judged by the goals that the probe sent while another one was active (`preempt: true`): the
    new one is accepted, and the old one ends in time, canceled or aborted, without success.
    """
    goals = answered_goals(recording, parameters, lambda goal: goal.preempts)
    sent = [goal for goal in recording.goals if goal.action == parameters.action]
    for goal in goals:
        number = sent.index(goal)
        if number == 0:
            return Finding.error(
                parameters.asked_for, "there is no goal before it that it could end"
            )
        old = sent[number - 1]
        stop_if(why_rejected(recording, old) or why_rejected(recording, goal))
        stop_if(_why_goes_on(recording, old, goal, parameters.within))
    return Finding.passed(parameters.asked_for, "the old goal ended", evidence(recording, goals[0]))


def _why_goes_on(recording: Recording, old: Goal, new: Goal, within_s: float) -> Cause | None:
    """Why the old goal was not ended by the new one, or None if it was."""
    hint = (
        "Keep the current goal handle, and call its abort() when a new goal comes "
        "(handle_accepted_callback); look at is_active in every round of the loop."
    )
    if old.result_ns is None:
        seen = f"{the_goal(old)} was still worked on at the end"
        never = _why_no_end(recording, seen, new.sent_ns, within_s)
        return never or Cause(seen, hint, evidence(recording, old))
    if old.result_ns < new.sent_ns:
        late_s = (new.sent_ns - old.result_ns) / NS
        if recording.stolen_s(old.sent_ns, new.sent_ns) >= late_s:
            return Cause.to_repeat("the old goal had ended before the new one was sent")
        return _ended_alone(recording, old)
    if old.status == "succeeded":
        seen = f"{the_goal(old)} was worked on to its end, and succeeded"
        return Cause(seen, hint, evidence(recording, old))
    seen = f"after the new goal was sent, {the_goal(old)} did not end"
    sent_ns, end_ns, shown = new.sent_ns, old.result_ns, evidence(recording, old)
    return why_late(recording, ACTION, old.action, sent_ns, end_ns, within_s, seen, hint, shown)
