"""How the checks must end for a mutant or a variant, and where they ended otherwise."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from grader.assignment.model import Assignment
from grader.assignment.mutant import Change, Mutant
from grader.assignment.selection import required_by
from grader.findings.finding import Status


def expected_statuses(
    assignment: Assignment, change: Change, put_right: Collection[str] = ()
) -> dict[str, Status]:
    """How each check must end for a mutant or a variant, by its id, in the author's order.

    Args:
        put_right: Checks that fail by a wrong name which the runs put right: nothing that
            requires them is skipped.
    """
    lost = set(change.loses if isinstance(change, Mutant) else ())
    stopping = lost.difference(put_right)
    requires = {spec.id: spec.requires for spec in assignment.checks}
    statuses = {}
    for check in requires:
        if required_by(check, requires) & stopping:
            statuses[check] = Status.SKIPPED
        else:
            statuses[check] = Status.FAILED if check in lost else Status.PASSED
    return statuses


def deviations(expected: Mapping[str, Status], actual: Mapping[str, Status]) -> dict[str, str]:
    """Checks that ended otherwise than they must, each with ``passed instead of failed``."""
    ended = {check: actual[check].value if check in actual else "no result" for check in expected}
    return {
        check: f"{ended[check]} instead of {status.value}"
        for check, status in expected.items()
        if ended[check] != status.value
    }
