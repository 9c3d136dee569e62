"""Write Gradescope's results.json, before the run as well.

Gradescope itself shows each test to students when its ``visibility`` says so, and the hidden
ones only to staff; so this is made from the whole result, and only its summary from the
student's copy.
Source: https://gradescope-autograders.readthedocs.io/en/latest/specs/
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from grader.checks.finding import Status
from grader.errors import UsageError
from grader.report.formats import markdown
from grader.report.formats.options import FormatOptions
from grader.report.model.result import read_json
from grader.report.model.result_model import CheckPart, Result
from grader.report.model.student import for_student
from grader.report.text import explanation

_UNFINISHED = (
    "**Grading did not finish.** This 0 is a placeholder and not your score: the autograder was "
    "stopped before it was done, most often by Gradescope's time limit. Ask the course staff to "
    "run it again."
)
_NOT_GRADED = (
    "**Not graded.** This 0 is a placeholder and not your score: something of the autograder or "
    "of its machine failed, which is no fault of your submission. Ask the course staff to run it "
    "again."
)


def unfinished() -> str:
    """What stands in ``results.json`` until there is a grade."""
    return _json(
        {
            "score": 0,
            "output": _UNFINISHED,
            "output_format": "md",
            "visibility": "visible",
            "stdout_visibility": "hidden",
            "extra_data": {"graded": False},
            "tests": [],
        }
    )


def render(result: Result, options: FormatOptions) -> str:
    """The whole file."""
    file = options.gradescope_metadata
    return render_gradescope(result, read_metadata(file) if file is not None else None)


def render_gradescope(result: Result, metadata: Mapping[str, Any] | None = None) -> str:
    """Render a result as ``results.json``.

    Args:
        metadata: Gradescope's ``submission_metadata.json``, or None.
    """
    copy = for_student(result)
    extra: dict[str, Any] = {
        "graded": result.graded,
        "rosgrade_version": result.rosgrade_version,
        "assignment_sha256": result.assignment.sha256,
        "submission_sha256": result.submission.sha256,
        # Whether there is one is up to Gradescope's container, and staff see it nowhere else.
        "sandbox": result.environment.get("sandbox"),
    }
    if metadata is not None:
        extra["created_at"] = metadata.get("created_at")
        extra["late_s"] = late_s(metadata)
    return _json(
        {
            "score": result.score if result.score is not None else 0,
            "execution_time": round(result.duration_s),
            "output": _output(result),
            "output_format": "md",
            "test_output_format": "md",
            "test_name_format": "text",
            "visibility": "visible",
            "stdout_visibility": "hidden",
            "extra_data": extra,
            "tests": [_test(number, check, copy) for number, check in enumerate(result.checks, 1)],
        }
    )


def read_metadata(file: Path) -> Mapping[str, Any]:
    """Read Gradescope's ``submission_metadata.json``.

    Raises:
        UsageError: It cannot be read, or is not one.
    """
    data = read_json(file)
    if not isinstance(data, dict):
        raise UsageError(f"{file} is not Gradescope's submission_metadata.json: no object in it")
    return data


def late_s(metadata: Mapping[str, Any]) -> float | None:
    """How long after its due date a submission came, by the times in its metadata.

    Args:
        metadata: Gradescope's ``submission_metadata.json``. A due date of the student's own (an
            extension) goes before the assignment's.

    Returns:
        Seconds, 0 where it was in time; None where there is no due date.

    Raises:
        UsageError: A time cannot be read.
    """
    due: Any = _mapping(metadata.get("assignment")).get("due_date")
    for user in metadata.get("users") or ():
        due = _mapping(_mapping(user).get("assignment")).get("due_date") or due
    created = metadata.get("created_at")
    if not due or not created:
        return None
    try:
        late = datetime.fromisoformat(_offset(created)) - datetime.fromisoformat(_offset(due))
    except (TypeError, ValueError) as error:
        raise UsageError(
            f"submission_metadata.json: created_at {created!r} and due_date {due!r} are not two "
            "times in ISO 8601 with an offset"
        ) from error
    return max(0.0, late.total_seconds())


def _offset(time: str) -> str:
    # Python 3.10 reads no "Z".
    return time.removesuffix("Z") + "+00:00" if time.endswith("Z") else time


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _output(result: Result) -> str:
    copy = for_student(result)
    if not result.graded:
        return "\n".join([_NOT_GRADED, *_notes(copy)])
    lines = [f"**{explanation.score(copy)}.** {explanation.headline(copy)}"]
    return "\n".join([*lines, *markdown.first_to_fix(copy), *_notes(copy)])


def _notes(result: Result) -> Iterator[str]:
    for block in markdown.notes(result):
        yield f"\n{block.rstrip()}"


def _test(number: int, check: CheckPart, copy: Result) -> dict[str, Any]:
    test: dict[str, Any] = {
        "number": str(number),
        "name": check.title,
        "output": markdown.explained(check, copy),
        "output_format": "md",
        "tags": [check.scenario] if check.scenario else [],
        "visibility": check.visibility,
        "extra_data": {"id": check.id, "status": check.status.value},
    }
    if copy.graded:
        test |= {"score": check.points, "max_score": check.max_points}
    if check.status is not Status.ERROR:
        test["status"] = "passed" if check.status is Status.PASSED else "failed"
    return test


def _json(data: dict[str, Any]) -> str:
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
