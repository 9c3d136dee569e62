"""Checks of actions: goals are accepted or rejected, give feedback, and come to an end.

That is their own, with a result, or they are canceled or preempted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from pydantic import Field, model_validator

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
from grader.checks.requests import Offered, is_offered, judged_requests, timeline, why_other_fields
from grader.diagnosis.explanation import cause_of, mistaken, remedy
from grader.diagnosis.no_answer import NoAnswer, why_late
from grader.diagnosis.no_endpoint import ACTION
from grader.diagnosis.process.not_called import ANSWER_S, why_raised
from grader.diagnosis.process.process_exit import why_ended
from grader.diagnosis.unended_goal import ended_alone, why_no_end, why_not_canceled
from grader.findings.fields import FieldTolerance, the_goal, unlike, words
from grader.findings.finding import Evidence, Finding
from grader.findings.value import EXACT
from grader.findings.words import code, counted, percent
from grader.recording.interaction import Goal
from grader.recording.model import NS, Recording
from grader.spec.name import TopicName
from grader.spec.names import Thing
from grader.spec.quantity import Duration, Frequency, Ratio
from grader.spec.unit import format_duration


class ActionExists(Offered):
    """Parameters of action.exists."""

    kind, thing, called = ACTION, Thing.ACTION, "{self.action}"

    action: TopicName = Field(description="Fully qualified action name.")


@check("action.exists", Subject.RECORDING, ActionExists)
def exists(recording: Recording, parameters: ActionExists) -> Finding:
    """The node offers the action.

    Judged by the ROS graph: the student's node had an action server of this type.
    """
    return is_offered(recording, parameters)


class OfGoals(Parameters):
    """Part of the parameters of every check of goals."""

    needs = (Stimulated(Act.SEND_GOAL, "action"),)
    doubt = Doubt.ANSWER_MISSED

    action: TopicName = Field(description="Action that a `send_goal` of the scenario sends to.")
    goal: dict[str, Any] = Field(
        default_factory=dict, description="Judge only goals with these fields; by default all."
    )

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields of the goal."""
        yield NamedFields(("goal",), self.action, self.goal)

    @property
    def words(self) -> str:
        """The goals in words."""
        which = f" ({words(self.goal)})" if self.goal else ""
        return f"the goal{which} of {code(self.action)}"


def answered_goals(
    recording: Recording, parameters: OfGoals, is_judged: Callable[[Goal], bool] = lambda _: True
) -> tuple[Goal, ...]:
    """The goals that a check judges, each accepted or rejected; ends the check without any."""
    found = judged_requests(
        recording, ACTION, parameters.action, recording.goals, parameters.goal, is_judged
    )
    for goal in found:
        if goal.accepted is None:
            what = f"{the_goal(goal)} was neither accepted nor rejected"
            silence = NoAnswer(recording, what, ACTION, goal.action, goal.sent_ns, ANSWER_S)
            stop_if(cause_of(silence))
    return found


def is_undisturbed(goal: Goal) -> bool:
    """Whether the probe let a goal come to its own end."""
    return goal.cancel_after_s is None and not goal.preempted


def _is_to_cancel(goal: Goal) -> bool:
    return goal.cancel_after_s is not None


def why_rejected(recording: Recording, goal: Goal) -> Finding | None:
    """Why a goal that should have been accepted was not, or None if it was."""
    if goal.accepted is not False:
        return None
    return mistaken("rejected_goal", f"{the_goal(goal)} was rejected", evidence(recording, goal))


def evidence(recording: Recording, goal: Goal) -> Evidence:
    """What became of a goal, step by step."""
    agreed = "accepted" if goal.cancel_accepted else "refused"
    steps = [
        (goal.sent_ns, f"goal sent: {words(goal.goal)}"),
        (goal.answered_ns, "accepted" if goal.accepted else "rejected"),
        *((item.time_ns, f"feedback: {words(item.value)}") for item in goal.feedback),
        *((time_ns, f"status: {status}") for time_ns, status in goal.statuses),
        (goal.canceled_ns, "asked to cancel"),
        (goal.cancel_answered_ns, f"cancel {agreed}"),
        (goal.result_ns, f"{goal.status}: {words(goal.result or {})}"),
    ]
    known = [(at_ns, text) for at_ns, text in steps if at_ns is not None]
    return timeline(recording, f"A goal of {goal.action}", known)


class Rejects(OfGoals):
    """Parameters of action.rejects."""

    asks = "{self.words} is rejected"


@check("action.rejects", Subject.RECORDING, Rejects)
def rejects(recording: Recording, parameters: Rejects) -> Finding:
    """The goal is rejected.

    Judged by the server's answer to the goals that the probe sent.
    """
    goals = answered_goals(recording, parameters)
    for goal in goals:
        if goal.accepted:
            then = f", then {goal.status}" if goal.status else ""
            seen = f"{the_goal(goal)} was accepted{then}"
            return mistaken("accepted_goal", seen, evidence(recording, goal))
    return Finding.as_asked("it was rejected", evidence(recording, goals[0]))


class FeedbackOf(OfGoals):
    """Parameters of action.feedback."""

    at_least: int = Field(1, ge=1, description="Least number of feedback messages for each goal.")
    rate: Frequency | None = Field(
        None, description="Expected rate of the feedback; by default any."
    )
    tolerance: Ratio = Field(0.1, description="How far the mean rate may be from `rate`.")
    first: dict[str, Any] = Field(
        default_factory=dict, description="Expected fields of the first feedback of a goal."
    )
    last: dict[str, Any] = Field(
        default_factory=dict, description="Expected fields of the last feedback of a goal."
    )

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields of the goal and of the feedback."""
        yield from super().named_fields()
        yield NamedFields(("first",), self.action, self.first, part=2)
        yield NamedFields(("last",), self.action, self.last, part=2)

    @model_validator(mode="after")
    def _enough(self) -> FeedbackOf:
        if self.rate is not None and self.at_least < 3:
            raise ValueError("'rate' needs 'at_least': 3 messages of feedback or more")
        return self

    def _asked(self) -> str:
        asked = f"at least {counted(self.at_least, 'message')} of feedback"
        if self.rate is not None:
            asked += f" at {self.rate:g} Hz (within {percent(self.tolerance)})"
        if self.first:
            asked += f", the first with {words(self.first)}"
        if self.last:
            asked += f", the last with {words(self.last)}"
        return f"{asked}, for {self.words}"


@check("action.feedback", Subject.RECORDING, FeedbackOf)
def feedback(recording: Recording, parameters: FeedbackOf) -> Finding:
    """The action gives feedback while it works.

    Judged by the feedback that the probe received for each accepted goal that was not canceled or
    preempted: number, mean rate, and fields of the first and the last feedback.
    """
    goals = answered_goals(recording, parameters, is_undisturbed)
    stop_if_any(
        why_rejected(recording, goal)
        or _why_little_feedback(recording, goal, parameters)
        or _why_other_rate(recording, goal, parameters)
        or _why_other_feedback(recording, goal, parameters)
        for goal in goals
    )
    number = min(len(goal.feedback) for goal in goals)
    at = f" at {_rate_hz(goals[0]):.3g} Hz" if len(goals[0].feedback) > 1 else ""
    shown = evidence(recording, goals[0])
    return Finding.as_asked(f"{counted(number, 'message')}{at}", shown)


def _rate_hz(goal: Goal) -> float:
    span_ns = goal.feedback[-1].time_ns - goal.feedback[0].time_ns
    return (len(goal.feedback) - 1) * NS / span_ns if span_ns > 0 else float("inf")


def _why_little_feedback(
    recording: Recording, goal: Goal, parameters: FeedbackOf
) -> Finding | None:
    if len(goal.feedback) >= parameters.at_least:
        return None
    seen = f"{the_goal(goal)} gave {counted(len(goal.feedback), 'message')} of feedback"
    seen += f" and then {goal.status}" if goal.status else ""
    raised = why_raised(recording, seen, goal.sent_ns)
    return raised or mistaken("no_feedback", seen, evidence(recording, goal))


def _why_other_rate(recording: Recording, goal: Goal, parameters: FeedbackOf) -> Finding | None:
    if parameters.rate is None:
        return None
    rate_hz = _rate_hz(goal)
    if abs(rate_hz - parameters.rate) <= parameters.tolerance * parameters.rate:
        return None
    begin_ns, end_ns = goal.feedback[0].time_ns, goal.feedback[-1].time_ns
    seen = f"feedback came at {rate_hz:.3g} Hz"
    due_s = (len(goal.feedback) - 1) / parameters.rate
    late_s = (end_ns - begin_ns) / NS - due_s * (1.0 + parameters.tolerance)
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    if 0.0 < late_s <= stolen_s:
        return Finding.held_up(seen, stolen_s)
    takes, shown = format_duration(1.0 / parameters.rate), evidence(recording, goal)
    return mistaken("feedback_rate", seen, shown, takes=takes)


def _why_other_feedback(recording: Recording, goal: Goal, parameters: FeedbackOf) -> Finding | None:
    shown = evidence(recording, goal)
    hint = remedy("other_feedback")
    for which, index, wanted in (("first", 0, parameters.first), ("last", -1, parameters.last)):
        seen, value = f"the {which} feedback of {the_goal(goal)} has", goal.feedback[index].value
        other = unlike(value, wanted, EXACT)
        cause = why_other_fields(seen, f"{which} feedback", value, other, shown, hint)
        if cause is not None:
            return cause
    return None


class Result(OfGoals):
    """Parameters of action.result."""

    needs = (Stimulated(Act.SEND_GOAL, "action", fields="goal", within="within"),)

    result: dict[str, Any] = Field(
        default_factory=dict,
        description="Expected fields of the result, nested or by path; others do not matter.",
    )
    status: str = Field(
        "succeeded",
        pattern="^(succeeded|aborted|canceled)$",
        description="How the goal ends: `succeeded`, `aborted`, or `canceled` (then the goals with "
        "`cancel_after` are judged).",
    )
    tolerance: FieldTolerance = EXACT
    within: Duration = Field(description="Longest time from the goal to its result.")

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields of the goal and of the result."""
        yield from super().named_fields()
        yield from toleranced("result", self.action, self.result, self.tolerance, part=1)

    def _asked(self) -> str:
        wanted = f" with {words(self.result)}" if self.result else ""
        return f"{self.words} ends as {self.status}{wanted} within {format_duration(self.within)}"


@check("action.result", Subject.RECORDING, Result)
def result(recording: Recording, parameters: Result) -> Finding:
    """The action ends with the expected result.

    Judged by the results of the accepted goals that were not canceled or preempted; or with
    `status: canceled` of those that the probe asked to cancel.
    """
    is_canceled = parameters.status == "canceled"
    is_judged = _is_to_cancel if is_canceled else is_undisturbed
    goals = answered_goals(recording, parameters, is_judged)
    stop_if_any(
        why_rejected(recording, goal)
        or _why_no_result(recording, goal, parameters.within)
        or _why_other_status(recording, goal, parameters)
        or _why_other_result(recording, goal, parameters)
        for goal in goals
    )
    observed = f"{goals[0].status}: {words(goals[0].result or {})}"
    return Finding.as_asked(observed, evidence(recording, goals[0]))


def _why_other_status(recording: Recording, goal: Goal, parameters: Result) -> Finding | None:
    if goal.status == parameters.status:
        return None
    seen = f"{the_goal(goal)} {goal.status or 'has no status'}"
    call = {"succeeded": "succeed", "aborted": "abort", "canceled": "canceled"}[parameters.status]
    shown = evidence(recording, goal)
    if goal.status != "aborted":
        return mistaken("not_ended", seen, shown, call=call)
    raised = why_raised(recording, seen, goal.sent_ns)
    return raised or mistaken("aborted", seen, shown, call=call)


def _why_no_result(recording: Recording, goal: Goal, within_s: float) -> Finding | None:
    seen = f"the result of {the_goal(goal)} did not come"
    silence = NoAnswer(recording, seen, ACTION, goal.action, goal.sent_ns, within_s)
    return why_late(silence, goal.result_ns, "slow_goal", evidence(recording, goal))


def _why_other_result(recording: Recording, goal: Goal, parameters: Result) -> Finding | None:
    seen, shown = f"the result of {the_goal(goal)} has", evidence(recording, goal)
    other = unlike(goal.result or {}, parameters.result, parameters.tolerance)
    return why_other_fields(seen, "result", goal.result, other, shown)


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
    goals = answered_goals(recording, parameters, _is_to_cancel)
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
        if goal == sent[0]:
            return Finding.ours("there is no goal before it that it could end")
        old = sent[sent.index(goal) - 1]
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
        cause = why_no_end(recording, seen, sent_ns, within_s)
        return cause or mistaken(mistake, seen, shown)
    if end_ns < sent_ns:
        if recording.stolen_s(old.sent_ns, sent_ns) >= (sent_ns - end_ns) / NS:
            return Finding.undecided("the old goal had ended before the new one was sent")
        return ended_alone(recording, old, shown)
    if old.status == "succeeded":
        return mistaken(mistake, f"{the_goal(old)} was worked on to its end, and succeeded", shown)
    seen = f"after the new goal was sent, {the_goal(old)} did not end"
    silence = NoAnswer(recording, seen, ACTION, old.action, sent_ns, within_s)
    return why_late(silence, end_ns, mistake, shown)
