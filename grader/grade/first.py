"""What the checks of a submission say together: is it graded, what should be mended first? Pure."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from typing import Protocol

from grader.checks.finding import Status


class _Place(Protocol):
    """A line of the student's code with what is wrong there."""

    @property
    def file(self) -> str: ...
    @property
    def line(self) -> int | None: ...
    @property
    def message(self) -> str: ...


class _Moment(Protocol):
    """A time in a run."""

    @property
    def time_s(self) -> float: ...


class _Evidence(Protocol):
    """Where a finding can be seen."""

    @property
    def places(self) -> Sequence[_Place]: ...
    @property
    def moments(self) -> Sequence[_Moment]: ...


def reason(check: str, scenario: str | None, observed: str, evidence: _Evidence) -> Hashable:
    """Why a check failed: equal for those that name the same mistake.

    That is the same line of the student's code, in whichever run, or the same said of the same
    moment of a run. What names neither, or only a file, is a mistake of its own.
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
        without_points: Checks that are worth none.

    Returns:
        The check, or None where none failed that must be mended.
    """

    def others(check: str) -> int:
        same = {name for name, reason in reasons.items() if reason == reasons[check]}
        return len(same) - 1 + sum(not same.isdisjoint(one) for one in waits)

    shown = only_shown(without_points, waits)
    return max((check for check in reasons if check not in shown), key=others, default=None)


class _Judged(Protocol):
    """How a check ended."""

    @property
    def id(self) -> str: ...
    @property
    def status(self) -> Status: ...
    @property
    def max_points(self) -> float: ...
    @property
    def waits_for(self) -> tuple[str, ...]: ...


def every_point_judged(checks: Iterable[_Judged]) -> bool:
    """Whether no check with points ended as an error, or waits for one that did."""
    checks = tuple(checks)
    errors = {check.id for check in checks if check.status is Status.ERROR}
    return not any(
        check.max_points and not errors.isdisjoint((check.id, *check.waits_for)) for check in checks
    )


def only_shown(without_points: Collection[str], waits: Iterable[Sequence[str]]) -> frozenset[str]:
    """Those of the checks without points that nothing else waits for."""
    return frozenset(without_points).difference(*waits)
