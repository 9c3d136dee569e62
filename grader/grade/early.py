"""Verdicts that are known while other scenarios still run."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from grader.assignment.load import LoadedAssignment
from grader.assignment.mutant import required_by
from grader.assignment.selection import select
from grader.findings.finding import Status
from grader.grade.judge import grade
from grader.grade.model import CheckResult
from grader.recording.model import Recording
from grader.submission.record import SubmissionRecord

_VERDICTS = (Status.PASSED, Status.FAILED)


def judge_early(
    loaded: LoadedAssignment,
    submission: SubmissionRecord,
    recordings: Mapping[str, Recording],
    checks: Collection[str],
) -> tuple[CheckResult, ...]:
    """Judge those of some checks that the runs so far decide.

    A check whose run may be repeated, because of the machine or a wrong name, is left out.
    """
    bound = {one.spec.id: one for one in loaded.checks}
    requires = {name: one.spec.requires for name, one in bound.items()}
    runs = {name: {run.id for run in loaded.scenarios_of(one)} for name, one in bound.items()}
    decided = [
        name
        for name in bound
        if name in checks
        and all(runs[one] <= recordings.keys() for one in {name, *required_by(name, requires)})
    ]
    if not decided:
        return ()
    return tuple(
        one
        for one in grade(select(loaded, tuple(decided)), submission, recordings).results
        if one.id in decided
        and one.status in _VERDICTS
        and not any(item.finding.disturbed or item.finding.remap for item in one.findings)
    )
