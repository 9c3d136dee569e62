"""From a check and what it looks at to its finding: a chain of steps, in the order of ``STEPS``."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from grader.assignment.binding import BoundCheck
from grader.checks.check import Parameters
from grader.checks.doubt import is_doubtful
from grader.checks.need import Recorded, SimulatedRobot
from grader.diagnosis.bag import why_not_in_bag
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_parameter import why_not_taken
from grader.diagnosis.not_built import why_lacking
from grader.findings.finding import Finding, Status, Verdict
from grader.findings.words import code, percent
from grader.grade.model import ScenarioFinding
from grader.grade.origins import with_origins
from grader.grade.windowed import judged_in
from grader.recording.model import BAG_RECEIVED, Recording
from grader.recording.submission import SubmissionRecord

NOT_YOURS = "Nothing to fix on your side: tell your instructor."


@dataclass(frozen=True)
class Case:
    """A check, and one subject that it judges.

    Attributes:
        recording: Of the scenario; without one the submission itself is judged.
        scenario: Its id.
        launched: Packages that the scenario launches something of.
    """

    bound: BoundCheck
    submission: SubmissionRecord
    recording: Recording | None = None
    scenario: str | None = None
    launched: tuple[str, ...] = ()

    def verdict(self, parameters: Parameters) -> Finding:
        """What the check says with some parameters, in its windows if it has any."""
        window, judge = self.bound.spec.window, self.bound.check.judge
        if self.recording is None:
            return judge(self.submission, parameters)
        if window is None:
            return judge(self.recording, parameters)
        return judged_in(window, judge, self.recording, parameters)


def judged(case: Case) -> ScenarioFinding:
    """The verdict of a check, and of a failure also what the steps add to it."""
    try:
        finding = why_no_motion(case) or case.verdict(case.bound.parameters)
        misuse = _misuse(finding)
        if misuse:
            finding = fault(f"the check {case.bound.check.name!r} {misuse}")
        for step in STEPS:
            if finding.status is Status.FAILED:
                finding = step(finding, case)
        finding = in_bag(finding, case)
    except Exception as error:
        # Any exception of a check is a bug in it, and must not cost the student points.
        trace = "".join(traceback.format_exception(error))
        message = f"{type(error).__name__}: {error}".rstrip(": ")
        return ScenarioFinding(case.scenario, fault(f"the check itself failed: {message}"), trace)
    return ScenarioFinding(case.scenario, finding)


def with_credit(finding: Finding, case: Case) -> Finding:
    """With the credit that looser parameters give."""
    for share, parameters in case.bound.partial:
        looser = case.verdict(parameters)
        if looser.status is Status.ERROR:
            return looser
        if looser.status is Status.PASSED and share > finding.credit:
            seen = f"{finding.observed}; this gives {percent(share)} of the points"
            return replace(finding, observed=seen, credit=share)
    return finding


def with_doubt(finding: Finding, case: Case) -> Finding:
    """Doubtful, if the failure may be an accident of its run."""
    recording = case.recording
    return finding.doubted(
        recording is not None and is_doubtful(recording, case.bound.parameters.doubt)
    )


def with_place(finding: Finding, case: Case) -> Finding:
    """With the places where the program makes what the finding is about."""
    if case.recording is None:
        return finding
    return with_origins(finding, case.bound.parameters, case.recording)


def with_what_was_not_taken(finding: Finding, case: Case) -> Finding:
    """First what the launch gives and no node takes.

    That costs the points of a check of its own, and may be why this one failed too.
    """
    recording = case.recording
    if recording is None or finding.names:
        return finding
    cause = not_taken(recording)
    if cause is None or finding.observed.startswith(cause.observed):
        return finding
    seen = f"{cause.observed}; {finding.observed}"
    return replace(finding, observed=seen, hint=cause.hint)


def with_what_is_lacking(finding: Finding, case: Case) -> Finding:
    """An error, if this machine lacks something of what the scenario launches."""
    return why_incomplete(case.submission, case.launched, finding.expected) or finding


def why_no_motion(case: Case) -> Finding | None:
    """Why a bag does not show the motion of the robot that a check judges; None if it does."""
    needs = [need for need in case.bound.parameters.needs if isinstance(need, SimulatedRobot)]
    recording = case.recording
    if recording is None or recording.bag is None or recording.scene is None or not needs:
        return None
    topics = [recording.scene.odometry_topic]
    if any(need.commanded for need in needs):
        topics.append(recording.scene.command_topic)
    cause = _lacking(recording, topics)
    if cause is None and recording.truth:
        return None
    if cause is None:
        seen = f"{code(topics[0])} in {code(recording.bag)} says too little: fewer than two poses"
        cause = mistaken("short_bag", seen)
    return replace(cause, expected=case.bound.parameters.asked_of(recording))


def with_what_the_bag_lacks(finding: Finding, case: Case) -> Finding:
    """Only what a bag does not have, if there is nothing in it to judge."""
    recording = case.recording
    if recording is None or recording.bag is None:
        return finding
    cause = _lacking(recording, _judged_topics(case))
    return replace(cause, expected=finding.expected) if cause else finding


def _lacking(recording: Recording, topics: Iterable[str]) -> Finding | None:
    return next(filter(None, (why_not_in_bag(recording, topic) for topic in topics)), None)


def in_bag(finding: Finding, case: Case) -> Finding:
    """Said of what a bag says: whose times these are, and that the odometry is the truth."""
    recording = case.recording
    if recording is None or recording.bag is None:
        return finding
    remarks = [f"in the bag {code(recording.bag)}"]
    for topic in dict.fromkeys(_judged_topics(case)):
        if (own := recording.in_bag(topic)) != topic:
            remarks.append(f"{code(own)} is called {code(topic)} here")
    if case.bound.check.family == "timing" and BAG_RECEIVED in recording.environment:
        remarks.append(
            "by the times when it was recorded, which vary more than those of publishing"
        )
    if any(isinstance(need, SimulatedRobot) for need in case.bound.parameters.needs):
        remarks.append("the odometry counts as where the robot is")
    expected = f"{finding.expected} ({'; '.join(remarks)})"
    observed = finding.observed
    if finding.status is Status.FAILED and recording.bag_notes:
        observed = f"{observed}; about the bag: {'; '.join(recording.bag_notes)}"
    return replace(finding, expected=expected, observed=observed)


def _judged_topics(case: Case) -> Iterator[str]:
    """The topics that a check, or one of its windows, judges."""
    window = case.bound.spec.window
    for parameters in (case.bound.parameters, *(window.phases.values() if window else ())):
        for need in parameters.needs:
            topic = getattr(parameters, need.topic) if isinstance(need, Recorded) else None
            if isinstance(need, Recorded) and topic is not None:
                yield f"{topic}{need.suffix}"
    topic = getattr(case.bound.parameters, "topic", None)
    if topic:
        yield topic


STEPS: tuple[Callable[[Finding, Case], Finding], ...] = (
    with_what_the_bag_lacks,
    with_credit,
    with_doubt,
    with_place,
    with_what_was_not_taken,
    with_what_is_lacking,
)
"""What happens to a finding that fails, in this order."""


def why_incomplete(
    submission: SubmissionRecord, packages: tuple[str, ...], expected: str
) -> Finding | None:
    """What this machine lacks for something that a scenario launches: an error, or None."""
    for package in packages:
        cause = why_lacking(submission, package)
        if cause is not None:
            return replace(cause.after(f"`{package}` could not run here"), expected=expected)
    return None


def not_taken(recording: Recording) -> Finding | None:
    """Which parameters the launch gives and no node takes, under no wrong name either; or None."""
    right = {one.asked for one in recording.names.wrong}
    return why_not_taken(recording, set(recording.given_parameters) - right)


def fault(observed: str) -> Finding:
    """A fault of rosgrade's or of the assignment's."""
    return Finding.error("a recording and a check that can be judged", observed, hint=NOT_YOURS)


def _misuse(finding: Any) -> str:
    """What is wrong with what a check returned; an instructor's own check is not typed."""
    if not isinstance(finding, Finding):
        return f"returned {type(finding).__name__} instead of a Finding"
    if finding.verdict is Verdict.SKIPPED:
        return "returned 'skipped', which only its requirements may decide"
    if finding.status is Status.FAILED and not 0.0 <= finding.credit < 1.0:
        return f"failed with a credit of {finding.credit}; it must be in [0, 1)"
    return ""
