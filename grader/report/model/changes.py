"""What differs between two grades of a submission. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from grader.grade.model import CheckResult, Grade


@dataclass(frozen=True)
class Change:
    """A check that came out differently.

    Attributes:
        before: Its result in the earlier grade; None where it was not judged.
    """

    before: CheckResult | None
    after: CheckResult


def changes(before: Grade, after: Grade) -> tuple[Change, ...]:
    """Find the checks whose status or points changed, in the author's order."""
    known = {result.id: result for result in before.results}
    return tuple(
        Change(known.get(result.id), result)
        for result in after.results
        if _outcome(known.get(result.id)) != _outcome(result)
    )


def _outcome(result: CheckResult | None) -> tuple[object, ...]:
    return () if result is None else (result.status, result.points, result.max_points)
