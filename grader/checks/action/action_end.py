"""Checks of actions whose goals do not come to their own end: canceled, or preempted."""

from __future__ import annotations

from pydantic import Field

from grader.checks.action.action import OfGoals, answered_goals, evidence, why_rejected
from grader.checks.check import Subject, check, stop_if, stop_if_any
from grader.checks.need import Act, Stimulated
from grader.diagnosis.mistake import mistaken
from grader.diagnosis.no_answer import NoAnswer, why_late
from grader.diagnosis.no_endpoint import ACTION
from grader.diagnosis.process.process_exit import why_ended
from grader.diagnosis.unended_goal import ended_alone, why_no_end, why_not_canceled
from grader.findings.fields import the_goal
from grader.findings.finding import Finding
from grader.recording.interaction import Goal
from grader.recording.model import NS, Recording
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration


class Cancels(OfGoals):
    """Parameters of action.cancels."""

    needs = (Stimulated(Act.SEND_GOAL, "action", having="cancel_after: 1 s"),)

    within: Duration = Field(
        1.0, description="Longest time from the cancel request to the end of the goal."
    )

    def _asked(self) -> str:
        return f"{self.words} is canceled within {format_duration(self.within)}"


@check("action.cancels", Subject.RECORDING, Cancels)
def cancels(recording: Recording, parameters: Cancels) -> Finding:
    """A goal can be canceled while it is executed.

    Judged by the goals that the probe asked to cancel (`cancel_after`): the server agrees, and
    the goal ends as canceled in time.
    """
    goals = answered_goals(recording, parameters, lambda goal: goal.cancel_after_s is not None)
    stop_if_any(
        why_rejected(recording, goal)
        or _why_not_asked(recording, goal)
        or why_not_canceled(recording, goal, parameters.within, evidence(recording, goal))
        for goal in goals
    )
    took_s = ((goals[0].result_ns or 0) - (goals[0].canceled_ns or 0)) / NS
    observed = f"canceled {format_duration(took_s)} after it was asked"
    return Finding.as_asked(observed, evidence(recording, goals[0]))


def _why_not_asked(recording: Recording, goal: Goal) -> Finding | None:
    """Why the goal was not asked to cancel: it ended too early, or the run did."""
    if goal.canceled_ns is not None:
        return None
    if goal.result_ns is None:
        late = Finding.undecided("the run ended before the goal was asked to cancel")
        return why_ended(recording) or late
    if (goal.result_ns - (goal.answered_ns or goal.sent_ns)) / NS > (goal.cancel_after_s or 0.0):
        return Finding.undecided("the probe was too late to ask for it")
    return ended_alone(recording, goal, evidence(recording, goal))


class Preempts(OfGoals):
    """Parameters of action.preempts."""

    needs = (Stimulated(Act.SEND_GOAL, "action", having="preempt: true"),)

    within: Duration = Field(
        1.0, description="Longest time from the new goal to the end of the old one."
    )

    def _asked(self) -> str:
        return f"{self.words} ends the goal before it within {format_duration(self.within)}"


@check("action.preempts", Subject.RECORDING, Preempts)
def preempts(recording: Recording, parameters: Preempts) -> Finding:
    """A new goal ends the goal that is executed.

    Judged by the goals that the probe sent while another one was active (`preempt: true`): the
    new one is accepted, and the old one ends in time, canceled or aborted, without success.
    """
    goals = answered_goals(recording, parameters, lambda goal: goal.preempts)
    sent = [goal for goal in recording.goals if goal.action == parameters.action]
    for goal in goals:
        number = sent.index(goal)
        if number == 0:
            text = "there is no goal before it that it could end"
            return Finding.ours(text)
        old = sent[number - 1]
        stop_if(why_rejected(recording, old) or why_rejected(recording, goal))
        stop_if(_why_goes_on(recording, old, goal, parameters.within))
    shown = evidence(recording, goals[0])
    return Finding.as_asked("the old goal ended", shown)


def _why_goes_on(recording: Recording, old: Goal, new: Goal, within_s: float) -> Finding | None:
    """Why the old goal was not ended by the new one, or None if it was."""
    sent_ns, end_ns, shown = new.sent_ns, old.result_ns, evidence(recording, old)
    mistake = "not_preempted"
    if end_ns is None:
        seen = f"{the_goal(old)} was still worked on at the end"
        return why_no_end(recording, seen, sent_ns, within_s) or mistaken(mistake, seen, shown)
    if end_ns < sent_ns:
        if recording.stolen_s(old.sent_ns, sent_ns) >= (sent_ns - end_ns) / NS:
            return Finding.undecided("the old goal had ended before the new one was sent")
        return ended_alone(recording, old, shown)
    if old.status == "succeeded":
        return mistaken(mistake, f"{the_goal(old)} was worked on to its end, and succeeded", shown)
    seen = f"after the new goal was sent, {the_goal(old)} did not end"
    silence = NoAnswer(recording, seen, ACTION, old.action, sent_ns, within_s)
    return why_late(silence, end_ns, mistake, shown)
