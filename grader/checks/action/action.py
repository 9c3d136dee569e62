"""Checks of actions: goals are accepted or rejected, give feedback, and have a result."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import Field, model_validator

from grader.checks.action.goals import (
    evidence,
    judged_goals,
    why_no_result,
    why_rejected,
)
from grader.checks.check import NamedFields, Parameters, Subject, check
from grader.checks.fields import (
    FieldTolerance,
    difference_table,
    difference_words,
    fields_hint,
    toleranced,
    unlike,
)
from grader.checks.fields import words as fields_words
from grader.checks.finding import Evidence, Finding, Plot
from grader.checks.need import Doubt, GoalSent
from grader.checks.value import EXACT, NoSuchField
from grader.checks.wording import code, counted, percent
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_answer import why_raised
from grader.diagnosis.no_endpoint import ACTION, is_offered
from grader.recording.interaction import Goal
from grader.recording.model import NS, Recording
from grader.spec.name import InterfaceName, TopicName
from grader.spec.quantity import Duration, Frequency, Ratio
from grader.spec.unit import format_duration


class ActionExists(Parameters):
    """Parameters of action.exists."""

    doubt = Doubt.ANSWER_MISSED

    action: TopicName = Field(description="Fully qualified action name.")
    type: InterfaceName | None = Field(
        None, description="Interface, such as example_interfaces/action/Fibonacci; by default any."
    )


@check("action.exists", Subject.RECORDING, ActionExists)
def exists(recording: Recording, parameters: ActionExists) -> Finding:
    """The node offers the action.

    Judged by the ROS graph: an action server of the student's was there, with this type.
    """
    return is_offered(recording, ACTION, parameters.action, parameters.type)


class OfGoals(Parameters):
    """Part of the parameters of every check of goals."""

    needs = (GoalSent(),)
    doubt = Doubt.ANSWER_MISSED

    action: TopicName = Field(description="Action that a `send_goal` of the scenario sends to.")
    goal: dict[str, Any] = Field(
        default_factory=dict,
        description="Which goals are judged: those with these fields; by default all that the "
        "check can be about.",
    )

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields of the goal."""
        yield NamedFields(("goal",), self.action, self.goal)

    @property
    def words(self) -> str:
        """The goals in words."""
        which = f" with {fields_words(self.goal)}" if self.goal else ""
        return f"the goal{which} of {code(self.action)}"


def undisturbed(goal: Goal) -> bool:
    """Whether the probe let a goal come to its own end."""
    return goal.cancel_after_s is None and not goal.preempted


def cannot(goal_type: str, error: NoSuchField, expected: str) -> Finding:
    """The finding for a field that the interface does not have: the author's mistake."""
    return Finding.error(expected, f"the assignment expects what {goal_type} cannot be: {error}")


def type_of(recording: Recording, action: str) -> str:
    """The type of the goals that were sent to an action."""
    return next((goal.type for goal in recording.goals if goal.action == action), action)


class Rejects(OfGoals):
    """Parameters of action.rejects."""


@check("action.rejects", Subject.RECORDING, Rejects)
def rejects(recording: Recording, parameters: Rejects) -> Finding:
    """The goal is rejected.

    Judged by the server's answer to the goals that the probe sent.
    """
    expected = f"{parameters.words} is rejected"
    try:
        goals = judged_goals(recording, parameters.action, parameters.goal)
    except NoSuchField as error:
        return cannot(type_of(recording, parameters.action), error, expected)
    if isinstance(goals, Cause):
        return goals.finding(expected)
    taken = [goal for goal in goals if goal.accepted]
    if not taken:
        return Finding.passed(expected, "it was rejected", evidence(recording, goals[0]))
    then = f", then {taken[0].status}" if taken[0].status else ""
    return Finding.failed(
        expected,
        f"the goal ({fields_words(taken[0].goal)}) was accepted{then}",
        "The ActionServer's goal_callback decides: it looks at the request and returns "
        "GoalResponse.REJECT. Without one every goal is accepted.",
        evidence(recording, taken[0]),
    )


class FeedbackOf(OfGoals):
    """Parameters of action.feedback."""

    at_least: int = Field(1, ge=1, description="Messages of feedback for each goal, at least.")
    rate: Frequency | None = Field(
        None, description="How often feedback comes, by default at any rate."
    )
    tolerance: Ratio = Field(0.1, description="How far the mean rate may be from it.")
    last: dict[str, Any] = Field(
        default_factory=dict, description="Expected fields of the last feedback of a goal."
    )

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields of the goal and of the feedback."""
        yield from super().named_fields()
        yield NamedFields(("last",), self.action, self.last, part=2)

    @model_validator(mode="after")
    def _enough(self) -> FeedbackOf:
        if self.rate is not None and self.at_least < 3:
            raise ValueError("a rate needs at_least: 3 messages of feedback or more")
        return self


@check("action.feedback", Subject.RECORDING, FeedbackOf)
def feedback(recording: Recording, parameters: FeedbackOf) -> Finding:
    """The action gives feedback while it works.

    Judged by the feedback that the probe received for each goal that was accepted and let come
    to its end: how much, at which mean rate, and what the last of it said.
    """
    expected = f"at least {counted(parameters.at_least, 'message')} of feedback"
    if parameters.rate is not None:
        expected += f" at {parameters.rate:g} Hz (within {percent(parameters.tolerance)})"
    if parameters.last:
        expected += f", the last with {fields_words(parameters.last)}"
    expected += f", for {parameters.words}"
    try:
        goals = judged_goals(recording, parameters.action, parameters.goal, undisturbed)
        if isinstance(goals, Cause):
            return goals.finding(expected)
        for goal in goals:
            cause = why_rejected(recording, goal) or _why_other_feedback(
                recording, goal, parameters
            )
            if cause is not None:
                return cause.finding(expected)
    except NoSuchField as error:
        return cannot(type_of(recording, parameters.action), error, expected)
    number = min(len(goal.feedback) for goal in goals)
    at = f" at {_rate_hz(goals[0]):.3g} Hz" if len(goals[0].feedback) > 1 else ""
    return Finding.passed(
        expected, f"{counted(number, 'message')}{at}", evidence(recording, goals[0])
    )


def _rate_hz(goal: Goal) -> float:
    span_ns = goal.feedback[-1].time_ns - goal.feedback[0].time_ns
    return (len(goal.feedback) - 1) * NS / span_ns if span_ns > 0 else float("inf")


def _why_other_feedback(recording: Recording, goal: Goal, parameters: FeedbackOf) -> Cause | None:
    found = goal.feedback
    shown = evidence(recording, goal)
    if len(found) < parameters.at_least:
        seen = f"the goal ({fields_words(goal.goal)}) gave {counted(len(found), 'message')} of "
        seen += f"feedback and then {goal.status}" if goal.status else "feedback"
        return why_raised(recording, seen, goal.sent_ns) or Cause(
            seen,
            "Call goal_handle.publish_feedback(feedback) in the loop of the execute callback.",
            shown,
        )
    if parameters.rate is not None:
        rate_hz = _rate_hz(goal)
        if abs(rate_hz - parameters.rate) > parameters.tolerance * parameters.rate:
            return _other_rate(recording, goal, parameters, rate_hz)
    wrong = unlike(found[-1].value, parameters.last, EXACT)
    if wrong:
        return Cause(
            f"the last feedback has {difference_words(wrong)}",
            "Set the fields of the feedback before each publish_feedback(feedback).",
            Evidence(shown.moments, tables=(difference_table("Last feedback", wrong),)),
        )
    return None


def _other_rate(recording: Recording, goal: Goal, parameters: FeedbackOf, rate_hz: float) -> Cause:
    begin_ns, end_ns = goal.feedback[0].time_ns, goal.feedback[-1].time_ns
    seen = f"feedback came at {rate_hz:.3g} Hz"
    due_s = (len(goal.feedback) - 1) / (parameters.rate or 1.0)
    late_s = (end_ns - begin_ns) / NS - due_s * (1.0 + parameters.tolerance)
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    if 0.0 < late_s <= stolen_s:
        return Cause.to_repeat(
            f"{seen}, but the machine took {format_duration(stolen_s)} from the process meanwhile"
        )
    times_s = [recording.since_launch_s(item.time_ns) for item in goal.feedback]
    plot = Plot(
        "Feedback", "time since launch (s)", "message of feedback", tuple(times_s),
        tuple(float(number) for number in range(1, len(times_s) + 1)),
    )  # fmt: skip
    return Cause(
        seen,
        f"Each round of the loop should take {format_duration(1.0 / (parameters.rate or 1.0))}.",
        Evidence(moments=evidence(recording, goal).moments, plots=(plot,)),
    )


class Result(OfGoals):
    """Parameters of action.result."""

    needs = (GoalSent(within="within"),)

    result: dict[str, Any] = Field(
        default_factory=dict,
        description="Expected fields of the result, nested or by path; others do not matter.",
    )
    status: str = Field(
        "succeeded",
        pattern="^(succeeded|aborted)$",
        description="How the goal ends: `succeeded` or `aborted`.",
    )
    tolerance: FieldTolerance = EXACT
    within: Duration = Field(description="How long after the goal the result may come.")

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields of the goal and of the result."""
        yield from super().named_fields()
        yield from toleranced("result", self.action, self.result, self.tolerance, part=1)


@check("action.result", Subject.RECORDING, Result)
def result(recording: Recording, parameters: Result) -> Finding:
    """The action ends with the expected result.

    Judged by the results of the goals that were accepted and let come to their end.
    """
    wanted = f" with {fields_words(parameters.result)}" if parameters.result else ""
    expected = (
        f"{parameters.words} {parameters.status}{wanted} within "
        f"{format_duration(parameters.within)}"
    )
    try:
        goals = judged_goals(recording, parameters.action, parameters.goal, undisturbed)
        if isinstance(goals, Cause):
            return goals.finding(expected)
        for goal in goals:
            cause = (
                why_rejected(recording, goal)
                or why_no_result(recording, goal, parameters.within)
                or _why_other_result(recording, goal, parameters)
            )
            if cause is not None:
                return cause.finding(expected)
    except NoSuchField as error:
        return cannot(type_of(recording, parameters.action), error, expected)
    shown = fields_words(goals[0].result or {})
    return Finding.passed(expected, f"{goals[0].status}: {shown}", evidence(recording, goals[0]))


def _why_other_result(recording: Recording, goal: Goal, parameters: Result) -> Cause | None:
    shown = evidence(recording, goal)
    if goal.status != parameters.status:
        seen = f"the goal ({fields_words(goal.goal)}) {goal.status or 'has no status'}"
        raised = why_raised(recording, seen, goal.sent_ns) if goal.status == "aborted" else None
        call = "succeed" if parameters.status == "succeeded" else "abort"
        return raised or Cause(
            seen,
            f"Call goal_handle.{call}() before the execute callback returns its result."
            + (" Without it rclpy aborts the goal." if goal.status == "aborted" else ""),
            shown,
        )
    wrong = unlike(goal.result or {}, parameters.result, parameters.tolerance)
    if not wrong:
        return None
    return Cause(
        f"the result of the goal ({fields_words(goal.goal)}) has {difference_words(wrong)}",
        fields_hint("result", goal.result or {}, [item.field for item in wrong]),
        Evidence(shown.moments, tables=(difference_table("Result", wrong), *shown.tables)),
    )
