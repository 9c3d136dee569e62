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
        bound.spec.id
        for bound in loaded.checks
        if bound.spec.id in checks
        and all(scenario.id in recordings for scenario in loaded.scenarios_of(bound))
    )
    if not decided:
        return ()
    part = select(loaded, decided, tuple(recordings))
    return tuple(
        result
        for result in judge_all(part, submission, recordings).results
        if result.id in decided
        and result.status in (Status.PASSED, Status.FAILED)
        and not any(item.finding.disturbed or item.finding.names for item in result.findings)
    )
