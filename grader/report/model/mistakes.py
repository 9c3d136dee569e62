"""Which failed checks name the same mistake, and which of them to correct first."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from grader.findings.finding import Status
from grader.report.model.result_model import CheckPart


def reasons(checks: Sequence[CheckPart]) -> dict[str, Hashable]:
    """Why each failed check failed, by id: equal for those that name the same mistake.

    That is the same line of the student's code, in any run, or the same text about the same
    moment of a run. A finding that names neither, or only a file, is a mistake of its own.
    """
    return {check.id: _reason(check) for check in checks if check.status is Status.FAILED}


def _reason(check: CheckPart) -> Hashable:
    places, moments = check.evidence.places, check.evidence.moments
    if places and all(one.line is not None for one in places):
        return tuple((one.file, one.line, one.message) for one in places)
    if moments:
        return check.scenario, check.observed, tuple(moment.time_s for moment in moments)
    return check.id


def others(check: str, checks: Sequence[CheckPart]) -> tuple[int, int]:
    """How many other checks failed for the same reason, and how many wait for any of them."""
    reason_of = reasons(checks)
    same = {name for name, reason in reason_of.items() if reason == reason_of[check]}
    waiting = [one for one in checks if not same.isdisjoint(one.waits_for)]
    return len(same) - 1, len(waiting)


def only_shown(checks: Sequence[CheckPart]) -> frozenset[str]:
    """Ids of the checks without points that did not pass, and that nothing else waits for."""
    not_passed = (Status.FAILED, Status.ERROR)
    pointless = {
        check.id for check in checks if check.status in not_passed and not check.max_points
    }
    return frozenset(pointless).difference(*(check.waits_for for check in checks))


def first_to_fix(checks: Sequence[CheckPart]) -> str | None:
    """Find the failed check on which most others depend; None where none needs a correction.

    A node that crashed does not stay alive, and has no publisher either: of checks that failed
    for the same reason the first stands for all, with the checks that wait for any of them. A
    check that is only shown need not be corrected.
    """
    shown = only_shown(checks)
    dependents = {check: sum(others(check, checks)) for check in reasons(checks)}
    candidates = [check for check in checks if check.id in dependents and check.id not in shown]
    if not candidates:
        return None
    most = max(dependents[check.id] for check in candidates)
    equals = [check for check in candidates if dependents[check.id] == most]
    return _earliest(equals).id


def _earliest(equals: Sequence[CheckPart]) -> CheckPart:
    """The author's first check; or that of its run which went wrong first, if times tell."""
    first = equals[0]
    if not first.evidence.moments:
        return first
    of_run = [one for one in equals if one.scenario == first.scenario and one.evidence.moments]
    return min(of_run, key=lambda one: one.evidence.moments[-1].time_s)
