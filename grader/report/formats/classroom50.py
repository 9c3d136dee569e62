"""Classroom 50's ``result.json`` and ``release-body.md``.

Its scores are whole numbers. So all points are multiplied by the smallest factor that makes the
points of every check whole, and partial credit is rounded down: only a check that passed has all
of its points. The release says the factor.
Source: https://github.com/foundation50/classroom50/wiki, "Advanced Autograding".
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from decimal import ROUND_FLOOR, Decimal
from typing import Any

from grader.errors import GraderFault, UsageError
from grader.findings.finding import Status
from grader.report.audience import Audience, written_for
from grader.report.formats.markdown import COMMENT_BYTES, render_markdown
from grader.report.model.result_model import Result
from grader.report.text import words

SCHEMA = "classroom50/result/v1"
RESULT_FILE = "result.json"
RELEASE_FILE = "release-body.md"
_IDENTITY = {
    "classroom": "CLASSROOM",
    "assignment": "ASSIGNMENT",
    "submission": "SUBMISSION_TAG",
    "commit": "COMMIT_URL",
    "release": "RELEASE_URL",
}
_FACTORS = (1, 2, 4, 5, 10, 20, 25, 50, 100)


def identity(environment: Mapping[str, str]) -> dict[str, str]:
    """What the runner of Classroom 50 says of the submission, by its variables."""
    missing = [name for name in _IDENTITY.values() if not environment.get(name)]
    if missing:
        raise UsageError(f"not started by Classroom 50: the environment lacks {', '.join(missing)}")
    found = {key: environment[name] for key, name in _IDENTITY.items()}
    return {**found, "review": environment.get("REVIEW_URL") or found["commit"]}


@written_for(Audience.STUDENT)
def render_result(result: Result, **identity: str) -> str:
    """Render ``result.json``.

    Args:
        identity: As of :func:`identity`; ``datetime`` is when the graded commit was made, ISO 8601
            in UTC: a regrade does not move it.
    """
    if not result.graded:
        raise GraderFault("not graded, so there is no result for Classroom 50")
    factor = whole_factor(result)
    tests: list[dict[str, Any]] = [
        {
            "test-name": check.title,
            "passed": check.status is Status.PASSED,
            "score": _whole(check.points, factor),
            "max-score": _whole(check.max_points, factor),
            "id": check.id,
            "status": check.status.value,
            "observed": check.observed,
        }
        for check in result.checks
    ]
    data = {
        "schema": SCHEMA,
        **identity,
        "graded_at": result.started,
        "score": sum(test["score"] for test in tests),
        "max-score": sum(test["max-score"] for test in tests),
        "tests": tests,
    }
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


@written_for(Audience.STUDENT)
def render_release(result: Result) -> str:
    """Render ``release-body.md``."""
    # A release may be twice as long, but its reader wants no more than the reader of a comment.
    text = render_markdown(result, COMMENT_BYTES)
    factor = whole_factor(result)
    if factor == 1:
        return text
    return (
        f"{text}\nClassroom 50 counts in whole points, so it shows every point as {factor}: "
        f"{words.counted_points(result.max_score)} are {_whole(result.max_score, factor)} there, "
        "and partial credit is rounded down.\n"
    )


def whole_factor(result: Result) -> int:
    """The smallest factor that makes the points of every check whole, at most 100."""
    points = [Decimal(repr(check.max_points)) for check in result.checks]
    return next(
        (n for n in _FACTORS if all((n * value) % 1 == 0 for value in points)), _FACTORS[-1]
    )


def _whole(points: float, factor: int) -> int:
    return int((Decimal(repr(points)) * factor).to_integral_value(ROUND_FLOOR))
