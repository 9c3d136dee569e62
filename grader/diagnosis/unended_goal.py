"""Why a goal of an action was not ended: not canceled when asked to, or not by a new goal."""

from __future__ import annotations

from dataclasses import dataclass

from grader.diagnosis.explanation import Symptom, cause_of, explanation, mistaken
from grader.diagnosis.no_answer import NoAnswer, why_late, why_taken
from grader.diagnosis.no_endpoint import ACTION
from grader.diagnosis.process.not_called import why_raised
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.fields import the_goal
from grader.findings.finding import Evidence, Finding
from grader.recording.interaction import Goal
from grader.recording.model import NS, Recording
from grader.spec.unit import format_duration

# Share of the time from the request to cancel until the end of the goal.
_AT_THE_END = 0.8


@dataclass(frozen=True)
class NotCanceled(Symptom[Finding], concept="executors"):
    """A goal was not canceled after a cancel request."""

    recording: Recording
    goal: Goal
    within_s: float
    evidence: Evidence

    @property
    def seen(self) -> str:
        """What happened instead."""
        if self.goal.result_ns is None:
            return f"{the_goal(self.goal)} was asked to cancel, but neither canceled nor ended"
        return f"{the_goal(self.goal)} {self.goal.status} instead of being canceled"

    @property
    def is_untaken(self) -> bool:
        """Whether the server did not handle the request to cancel, or only when the goal ended."""
        answered_ns, asked_ns = self.goal.cancel_answered_ns, self.goal.canceled_ns or 0
        if answered_ns is None:
            return True
        if self.goal.result_ns is None:
            return False
        # An executor that was busy until then answers right before it tells the result.
        waited = (answered_ns - asked_ns) / max(self.goal.result_ns - asked_ns, 1)
        return waited >= _AT_THE_END


def why_not_canceled(
    recording: Recording, goal: Goal, within_s: float, evidence: Evidence
) -> Finding | None:
    """Why a goal that was asked to cancel was not canceled in time, or None if it was."""
    asked_ns, end_ns = goal.canceled_ns or 0, goal.result_ns
    if goal.status != "canceled" or end_ns is None:
        return cause_of(NotCanceled(recording, goal, within_s, evidence))
    seen = f"{the_goal(goal)} was not canceled"
    silence = NoAnswer(recording, seen, ACTION, goal.action, asked_ns, within_s)
    return why_late(silence, end_ns, "canceled_late", evidence)


@explanation(NotCanceled)
def cancel_refused(symptom: NotCanceled) -> Finding | None:
    """The server refuses to cancel: it has no cancel_callback that accepts."""
    if symptom.goal.cancel_accepted is not False or symptom.is_untaken:
        return None
    return mistaken(
        "cancel_refused", f"the server refused to cancel {the_goal(symptom.goal)}", symptom.evidence
    )


@explanation(NotCanceled)
def execute_callback_raised(symptom: NotCanceled) -> Finding | None:
    """The execute callback raised an exception."""
    if symptom.goal.result_ns is None:
        return None
    return why_raised(symptom.recording, symptom.seen, symptom.goal.sent_ns)


@explanation(NotCanceled)
def executor_busy_with_the_goal(symptom: NotCanceled) -> Finding | None:
    """The executor cannot process the cancel request while the execute callback runs."""
    if not symptom.is_untaken:
        return None
    goal, recording = symptom.goal, symptom.recording
    seen = f"{symptom.seen}: the server did not handle the request to cancel"
    text = f"{seen}: its executor is busy while the execute callback runs"
    busy = mistaken("one_thread", text, symptom.evidence)
    if goal.result_ns is not None:
        return busy
    asked_ns, within_s = goal.canceled_ns or 0, symptom.within_s
    return cause_of(NoAnswer(recording, seen, ACTION, goal.action, asked_ns, within_s, busy))


@explanation(NotCanceled, general=True)
def request_ignored(symptom: NotCanceled) -> Finding:
    """The loop of the execute callback never checks whether the goal should be canceled."""
    if symptom.goal.result_ns is not None:
        seen = f"{symptom.seen}, although the server agreed to cancel"
        return mistaken("ignores_cancel", seen, symptom.evidence)
    asked_ns = symptom.goal.canceled_ns or 0
    never = why_no_end(symptom.recording, symptom.seen, asked_ns, symptom.within_s)
    seen = f"{symptom.seen}: the execute callback goes on"
    return never or mistaken("ignores_cancel", seen, symptom.evidence)


def why_no_end(recording: Recording, seen: str, asked_ns: int, within_s: float) -> Finding | None:
    """Why a goal never ended, if its process ended or had no time."""
    taken = why_taken(recording, seen, asked_ns, recording.stop_ns, within_s)
    return why_ended(recording, seen) or taken


def ended_alone(recording: Recording, goal: Goal, evidence: Evidence) -> Finding:
    """A goal came to an end before the probe could end it."""
    lasted_s = ((goal.result_ns or 0) - (goal.answered_ns or goal.sent_ns)) / NS
    seen = (
        f"{the_goal(goal)} {goal.status} {format_duration(lasted_s)} after it was accepted: too "
        "early for this check"
    )
    return why_raised(recording, seen, goal.sent_ns) or mistaken("ended_alone", seen, evidence)
