"""The part of a result that is the grade, and what of two grades differs.

The same submission graded again, on a busier machine or beside other submissions, gets the same
grade, byte for byte. Times, paths, logs, observed figures and the evidence that holds
them are measurements: they are never twice the same.
"""

from __future__ import annotations

from difflib import unified_diff
from typing import Any

from grader.report.model.result_model import Result

_FINDING = frozenset({"scenario", "status", "expected", "hint", "concept"})
_CHECK = _FINDING | {
    "id",
    "title",
    "points",
    "max_points",
    "visibility",
    "author_hint",
    "further_hints",
    "waits_for",
}
GRADE: dict[str, Any] = {
    "assignment": {"id", "sha256"},
    # Its name is not among it: the same submission of another student gets the same grade.
    "submission": {"sha256", "problem"},
    "score": True,
    "max_score": True,
    "graded": True,
    "first_to_fix": True,
    "checks": {
        "__all__": {**dict.fromkeys(_CHECK, True), "other_scenarios": {"__all__": set(_FINDING)}}
    },
    "withheld": True,
    "scenarios": {"__all__": {"id", "seed"}},
    "build": {"succeeded", "failed_packages"},
}
"""What of the model :class:`Result` is the grade, as pydantic's ``include``."""


def grade_json(result: Result) -> str:
    """The grade of a result as JSON; keys are always in the same order."""
    return result.model_dump_json(by_alias=True, include=GRADE, indent=2) + "\n"


def differences(one: str, other: str) -> list[str]:
    """The lines that differ between two grades, with the lines around them."""
    return list(unified_diff(one.splitlines(), other.splitlines(), lineterm=""))
