"""Goals that the probe sent: which of them a check is about, and what became of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from pydantic import Field

from grader.checks.check import NamedFields, Parameters, stop_if
from grader.checks.fields import words
from grader.checks.finding import Evidence
from grader.checks.need import Doubt, GoalSent
from grader.checks.requests import judged_requests, timeline
from grader.checks.wording import code
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_answer import why_raised, why_unanswered
from grader.diagnosis.no_server import ACTION
from grader.recording.interaction import Goal
from grader.recording.model import NS, Recording
from grader.spec.name import TopicName
from grader.spec.unit import format_duration

ANSWER_S = 1.0
"""How soon a server must say whether it accepts a goal: its callback only decides."""


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
        which = f" with {words(self.goal)}" if self.goal else ""
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
            stop_if(why_unanswered(recording, what, ACTION, goal.action, goal.sent_ns, ANSWER_S))
    return found


def is_undisturbed(goal: Goal) -> bool:
    """Whether the probe let a goal come to its own end."""
    return goal.cancel_after_s is None and not goal.preempted


def the_goal(goal: Goal) -> str:
    """A goal in words."""
    return f"the goal ({words(goal.goal)})"


def why_rejected(recording: Recording, goal: Goal) -> Cause | None:
    """Why a goal that should have been accepted was not, or None if it was."""
    if goal.accepted is not False:
        return None
    return Cause(
        f"{the_goal(goal)} was rejected",
        "A goal_callback must return GoalResponse.ACCEPT for a goal that is right; without one "
        "every goal is accepted.",
        evidence(recording, goal),
    )


def ended_alone(recording: Recording, goal: Goal) -> Cause:
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
