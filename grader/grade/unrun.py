"""Why a scenario has no recording, or none that tells much, where the reason lies in the build."""

from __future__ import annotations

from collections.abc import Iterable

from grader.checks.finding import Finding
from grader.diagnosis.not_built import why_lacking, why_not_built
from grader.submission.record import SubmissionRecord


def why_not_run(submission: SubmissionRecord, packages: Iterable[str]) -> Finding | None:
    """Say why nothing of a submission could be launched: one cause, the deepest.

    Returns:
        A finding, or None where every package was built: then it should have been run, and
        the missing recording is a fault of ours.
    """
    for package in packages:
        cause = why_not_built(submission, package)
        if cause is not None:
            return cause.after("was not run because the package was not built").finding(
                f"the package {package} to build, so that its nodes can be launched"
            )
    return None


def why_incomplete(
    submission: SubmissionRecord, packages: Iterable[str], expected: str
) -> Finding | None:
    """Say what this machine lacks for something that a scenario launches.

    Returns:
        An error, or None where the scenario could run as it would anywhere else.
    """
    for package in packages:
        cause = why_lacking(submission, package)
        if cause is not None:
            return cause.after(f"`{package}` could not run here").finding(expected)
    return None
