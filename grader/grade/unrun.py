"""Why a scenario has no recording, where the reason lies in the submission."""

from __future__ import annotations

from collections.abc import Iterable

from grader.assignment.model import Package
from grader.checks.finding import Finding
from grader.checks.unbuilt import why_not_built
from grader.submission.record import SubmissionRecord


def why_not_run(submission: SubmissionRecord, packages: Iterable[Package]) -> Finding | None:
    """Say why nothing of a submission could be launched: one cause, the deepest.

    Args:
        submission: What is known of it.
        packages: What the assignment asks for.

    Returns:
        A finding, or None where every package was built: then it should have been run, and
        the missing recording is a fault of ours.
    """
    for package in packages:
        cause = why_not_built(submission, package.name)
        if cause is not None:
            return cause.after("was not run because the package was not built").finding(
                f"the package {package.name} to build, so that its nodes can be launched"
            )
    return None
