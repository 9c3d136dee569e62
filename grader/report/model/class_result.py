"""What a class keeps of a result: the grade and its reasons, without what one report shows.

A class of 10,000 is held in memory as a whole, and plots, logs and figures would fill it.
"""

from __future__ import annotations

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
