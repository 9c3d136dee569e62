"""Failures of a class with the same cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from grader.findings.finding import Status
from grader.grade.model import points_for, total
from grader.report.model.cause import MOST_CHARACTERS, cause
from grader.report.model.class_row import ClassRow
from grader.report.model.result_model import CheckPart
from grader.report.text.words import cut
from grader.spec.safe_text import one_line

_NO_SHARES: Mapping[tuple[str, str], float] = {}


@dataclass(frozen=True)
class Cluster:
    """Failures of one check for one cause.

    Attributes:
        check: Id of the check.
        title: Of the check.
        cause: In words; together with ``check`` it names the cluster, also in ``class.yaml``.
        example: What the check observed of the first of them, whole.
        lost: Key of each student -> points that the check cost; in the order of the rows.
        forgiven: Share of the points that is given back now, in [0, 1].
    """

    check: str
    title: str
    cause: str
    example: str
    lost: dict[str, float]
    forgiven: float = 0.0

    @property
    def at_stake(self) -> float:
        """Points that the class lost by it."""
        return total(self.lost.values())

    def gains(self, share: float = 1.0) -> dict[str, float]:
        """What each student gets back if it is forgiven."""
        return {key: points_for(lost, share) for key, lost in self.lost.items()}


def clusters(
    rows: Sequence[ClassRow], forgiven: Mapping[tuple[str, str], float] = _NO_SHARES
) -> tuple[Cluster, ...]:
    """Group the failures of a class by check and cause, the most frequent first.

    Args:
        forgiven: Check and cause -> share of the points that is given back.
    """
    found: dict[tuple[str, str], list[tuple[str, CheckPart]]] = {}
    for row in rows:
        for check in row.judged:
            if check.status is Status.FAILED:
                found.setdefault((check.id, cause(check)), []).append((row.id, check))
    grouped = [
        Cluster(
            name,
            members[0][1].title,
            why,
            cut(one_line(_example(members[0][1])), MOST_CHARACTERS),
            {key: total((check.max_points, -check.points)) for key, check in members},
            forgiven.get((name, why), 0.0),
        )
        for (name, why), members in found.items()
    ]
    return tuple(sorted(grouped, key=lambda one: (-len(one.lost), -one.at_stake)))


def _example(check: CheckPart) -> str:
    return f"{check.cause}: {check.observed}" if check.cause else check.observed
