"""What the checks of a submission say together: is it graded, what should be mended first? Pure.

Asked of a grade and of a result that was read from a file, whose parts have the same attributes.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from typing import Any

from grader.checks.finding import Status


def reason(check: str, scenario: str | None, observed: str, evidence: Any) -> Hashable:
    """Why a check failed: equal for those that name the same mistake.

    That is the same line of the student's code, in whichever run, or the same said of the same
    moment of a run. What names neither, or only a file, is a mistake of its own.

    Args:
        evidence: Has ``places`` in the student's code and ``moments`` of the run.
    """
    if evidence.places and all(one.line is not None for one in evidence.places):
        return tuple((one.file, one.line, one.message) for one in evidence.places)
    if evidence.moments:
        return scenario, observed, tuple(moment.time_s for moment in evidence.moments)
    return check


def first_to_fix(
    reasons: Mapping[str, Hashable],
    waits: Sequence[Sequence[str]],
    without_points: Collection[str] = (),
) -> str | None:
    """Find the failed check on which most others depend; of equals, the author's first.

    A node that crashed does not stay alive, and has no publisher either: of checks that failed
    for the same reason the first stands for all, with whatever waits for any of them. What is
    shown without points, and keeps nothing else waiting, is nothing that must be mended.

    Args:
        reasons: Why each check failed, in the author's order; for the same reason, equal.
        waits: Of every check the failed ones that it waits for.
        without_points: Checks that are worth none.

    Returns:
        The check, or None where none failed that must be mended.
    """

    def others(check: str) -> int:
        same = {name for name, reason in reasons.items() if reason == reasons[check]}
        return len(same) - 1 + sum(not same.isdisjoint(one) for one in waits)

    shown = only_shown(without_points, waits)
    return max((check for check in reasons if check not in shown), key=others, default=None)


def every_point_judged(checks: Iterable[Any]) -> bool:
    """Whether no check with points ended as an error, or waits for one that did."""
    checks = tuple(checks)
    errors = {check.id for check in checks if check.status is Status.ERROR}
    return not any(
        check.max_points and not errors.isdisjoint((check.id, *check.waits_for)) for check in checks
    )


def only_shown(without_points: Collection[str], waits: Iterable[Sequence[str]]) -> frozenset[str]:
    """Those of the checks without points that nothing else waits for."""
    return frozenset(without_points).difference(*waits)
