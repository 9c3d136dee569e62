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
    found = reasons(checks)
    same = {name for name, reason in found.items() if reason == found[check]}
    return len(same) - 1, sum(not same.isdisjoint(one.waits_for) for one in checks)


def only_shown(checks: Sequence[CheckPart]) -> frozenset[str]:
    """Ids of the checks without points that did not pass, and that nothing else waits for."""
    lost = (Status.FAILED, Status.ERROR)
    mild = {check.id for check in checks if check.status in lost and not check.max_points}
    return frozenset(mild).difference(*(check.waits_for for check in checks))


def first_to_fix(checks: Sequence[CheckPart]) -> str | None:
    """Find the failed check on which most others depend.

    Of equals it is the author's first, or in the run of that one what went wrong first in time.

    A node that crashed does not stay alive, and has no publisher either: of checks that failed
    for the same reason the first stands for all, with the checks that wait for any of them. A
    check that is only shown need not be corrected. None where no check needs it.
    """
    shown = only_shown(checks)
    found = [check for check in reasons(checks) if check not in shown]
    most = max((sum(others(check, checks)) for check in found), default=0)
    equals = [one for one in checks if one.id in found and sum(others(one.id, checks)) == most]
    ends = [one for one in equals if one.scenario == equals[0].scenario and one.evidence.moments]
    if equals and equals[0] in ends:
        return min(ends, key=lambda one: one.evidence.moments[-1].time_s).id
    return equals[0].id if equals else None
