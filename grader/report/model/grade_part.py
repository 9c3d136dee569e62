"""The part of a result that is the grade, and what of two grades differs.

The same submission graded again, on a busier machine or beside other submissions, gets the same
grade, byte for byte. Times, paths, logs, observed figures and the evidence that holds
them are measurements: they are never twice the same.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
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
    grade = result.model_dump(mode="json", by_alias=True, include=GRADE)
    return json.dumps(grade, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def differences(one: str, other: str) -> list[str]:
    """Say what differs between two grades, one line each."""
    return list(_differences("", json.loads(one), json.loads(other)))


def _differences(place: str, one: Any, other: Any) -> Iterator[str]:
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        for key in one:
            yield from _differences(f"{place}.{key}".lstrip("."), one[key], other[key])
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, (left, right) in enumerate(zip(one, other, strict=True)):
            name = left.get("id", number) if isinstance(left, dict) else number
            yield from _differences(f"{place}[{name}]", left, right)
    elif one != other:
        yield f"{place}: {one!r}, then {other!r}"
