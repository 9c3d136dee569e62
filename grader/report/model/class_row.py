"""A row of a class: a student, what was handed in, its grade, and what of that is kept.

A class of 10,000 is held in memory as a whole, and plots, logs and figures would fill it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import TypeVar

from grader.findings.finding import Evidence, Status
from grader.report.model.result_model import CheckPart, FindingPart, Result

_MOST_SHARED = 10_000
Part = TypeVar("Part", bound=FindingPart)


def for_class(result: Result) -> Result:
    """Leave out what only the report of the submission shows.

    Statuses, points, titles and expectations stay, of what did not pass also what was observed
    and the reason; of the runs those that were disturbed.
    """
    return result.model_copy(
        update={
            "checks": tuple(map(_check, result.checks)),
            "scenarios": tuple(run for run in result.scenarios if run.disturbed),
            "build": None,
            "environment": {},
        }
    )


def _check(check: CheckPart) -> CheckPart:
    others = tuple(map(_finding, check.other_scenarios))
    return _finding(check.model_copy(update={"other_scenarios": others}))


def _finding(part: Part) -> Part:
    kept = {"traceback": "", "evidence": Evidence()}
    if part.status in (Status.FAILED, Status.ERROR):
        evidence = part.evidence
        kept["evidence"] = Evidence(moments=evidence.moments, places=evidence.places)
    else:
        kept["observed"] = ""
    same: Part = _shared(part.model_copy(update=kept))
    return same


@lru_cache(_MOST_SHARED)
def _shared(part: Part) -> Part:
    """The first part that is equal: most students pass the same checks with the same words."""
    return part


class RowStatus(str, Enum):
    """Whether a row has a grade, and if not, why."""

    GRADED = "graded"
    WAITING = "waits for a person"
    """Every check is judged, but not every manual item has its points."""
    NOT_GRADED = "not graded"
    """rosgrade or the machine failed, or the batch has not graded it yet."""
    UNREADABLE = "unreadable"
    """What was handed in cannot be read, or holds no package: nothing was built or run."""
    MISSING = "missing"
    """Nothing was handed in."""


@dataclass(frozen=True)
class ClassRow:
    """One row of a class.

    Attributes:
        name: The student's; may be empty.
        report: The HTML report, relative to the overview, or None where there is none.
        result: As in ``result.json``, or None where nothing could be graded at all.
        note: What an instructor should know, in a few words; empty for an ordinary one.
    """

    id: str
    name: str = ""
    report: str | None = None
    result: Result | None = None
    note: str = ""
    late: bool = False
    missing: bool = False

    @property
    def status(self) -> RowStatus:
        """Whether it has a grade, and if not, why."""
        if self.result is None:
            return RowStatus.MISSING if self.missing else RowStatus.NOT_GRADED
        if self.result.submission.problem is not None:
            return RowStatus.UNREADABLE
        if not self.result.graded:
            return RowStatus.NOT_GRADED
        return RowStatus.WAITING if self.result.final_score is None else RowStatus.GRADED

    @property
    def judged(self) -> tuple[CheckPart, ...]:
        """Its checks; none of what cannot be read."""
        if self.result is None or self.status is RowStatus.UNREADABLE:
            return ()
        return self.result.checks

    @property
    def graded(self) -> bool:
        """Whether it has a score."""
        return self.status is RowStatus.GRADED

    @property
    def cannot_be_graded(self) -> bool:
        """Whether something was handed in that got no grade."""
        return self.status in (RowStatus.NOT_GRADED, RowStatus.UNREADABLE)

    @property
    def score(self) -> float | None:
        """Its points with the adjustments; None where there is no grade, or not all of it yet."""
        return self.result.final_score if self.result is not None and self.graded else None

    @property
    def waits_for(self) -> tuple[str, ...]:
        """Titles of the manual items that wait for a person."""
        if self.status is not RowStatus.WAITING or self.result is None:
            return ()
        return tuple(one.title for one in self.result.adjustments if one.points is None)

    @property
    def full(self) -> bool:
        """Whether it got all points."""
        return self.result is not None and self.score == self.result.final_max_score

    @property
    def states(self) -> str:
        """Words that the overview filters by."""
        runs = self.result.scenarios if self.result is not None else ()
        found = {
            "full": self.full,
            "lost": self.graded and not self.full,
            "waiting": self.status is RowStatus.WAITING,
            "ungraded": self.status is RowStatus.NOT_GRADED,
            "unreadable": self.status is RowStatus.UNREADABLE,
            "missing": self.status is RowStatus.MISSING,
            "disturbed": any(run.disturbed for run in runs),
            "late": self.late,
        }
        return " ".join(word for word, holds in found.items() if holds)
