"""Verdicts that are known while other scenarios still run."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from grader.assignment.load import LoadedAssignment
from grader.assignment.selection import select
from grader.findings.finding import Status
from grader.grade.judging import judge_all
from grader.grade.model import CheckResult
from grader.recording.model import Recording
from grader.recording.submission import SubmissionRecord


def judge_early(
    loaded: LoadedAssignment,
    submission: SubmissionRecord,
    recordings: Mapping[str, Recording],
    checks: Collection[str],
) -> tuple[CheckResult, ...]:
    """Judge those of some checks whose own scenarios are all recorded.

    What they require is judged in the runs so far. A check whose run may be repeated, because of
    the machine or a wrong name, is left out.
    """
    decided = tuple(
        one.spec.id
        for one in loaded.checks
        if one.spec.id in checks and {run.id for run in loaded.scenarios_of(one)} <= set(recordings)
    )
    if not decided:
        return ()
    part = select(loaded, decided, tuple(recordings))
    return tuple(
        one
        for one in judge_all(part, submission, recordings).results
        if one.id in decided
        and one.status in (Status.PASSED, Status.FAILED)
        and not any(item.finding.disturbed or item.finding.names for item in one.findings)
    )
