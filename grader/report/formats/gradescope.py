"""Write Gradescope's results.json, also before the run.

Gradescope itself shows each test to students when its ``visibility`` says so, and the hidden
ones only to staff; so this is made from the whole result, and only its summary from the
student's copy.
Source: https://gradescope-autograders.readthedocs.io/en/latest/specs/
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import AwareDatetime, BaseModel, ValidationError

from grader.errors import UsageError
from grader.findings.finding import Status
from grader.report.audience import Audience, for_student, written_for
from grader.report.formats import markdown
from grader.report.model.result_model import CheckPart, Result
from grader.report.text import explanation

_UNFINISHED = (
    "**Grading did not finish.** This 0 is a placeholder and not your score: the autograder was "
    "stopped before it was done, most often by Gradescope's time limit. Ask the course staff to "
    "run it again."
)
_NOT_GRADED = (
    "**Not graded.** This 0 is a placeholder and not your score: something failed in the "
    "autograder or its machine. This is not a fault of your submission. Ask the course staff to "
    "run it again."
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


@written_for(Audience.INSTRUCTOR)
def render(result: Result, *, metadata: Path | None = None) -> str:
    """The whole file.

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
        times = read_metadata(metadata)
        extra |= {"created_at": times.created_at.isoformat(), "late_s": times.late_s}
    return _json(
        {
            "score": result.known_score if result.known_score is not None else 0,
            "execution_time": round(result.duration_s),
            "output": _output(copy, graded=result.graded),
            "output_format": "md",
            "test_output_format": "md",
            "test_name_format": "text",
            "visibility": "visible",
            "stdout_visibility": "hidden",
            "extra_data": extra,
            "tests": [_test(number, check, copy) for number, check in enumerate(result.checks, 1)],
        }
    )


class _Due(BaseModel):
    due_date: AwareDatetime | None = None


class _User(BaseModel):
    assignment: _Due | None = None


class Metadata(BaseModel):
    """What Gradescope's ``submission_metadata.json`` says of times."""

    created_at: AwareDatetime
    assignment: _Due = _Due()
    users: tuple[_User, ...] = ()

    @property
    def late_s(self) -> float | None:
        """Seconds from the due date to the submission, at least 0; None without a due date.

        A due date of the student's own (an extension) goes before the assignment's.
        """
        due = self.assignment.due_date
        for user in self.users:
            if user.assignment is not None and user.assignment.due_date is not None:
                # Of a group the last member's counts.
                due = user.assignment.due_date
        if due is None:
            return None
        return max(0.0, (self.created_at - due).total_seconds())


def read_metadata(file: Path) -> Metadata:
    """Read Gradescope's ``submission_metadata.json``."""
    try:
        return Metadata.model_validate_json(file.read_bytes())
    except OSError as error:
        raise UsageError(f"{file} cannot be read: {error.strerror}") from error
    except ValidationError as error:
        raise UsageError(f"{file} is not Gradescope's submission_metadata.json: {error}") from error


def _output(copy: Result, *, graded: bool) -> str:
    lines = [_NOT_GRADED]
    if graded:
        score = f"**{explanation.score(copy)}.** {explanation.headline(copy)}"
        lines = [score, *markdown.first_to_fix(copy)]
    blocks = (*markdown.added(copy), *markdown.notes(copy))
    return "\n".join([*lines, *(f"\n{block.rstrip()}" for block in blocks)])


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
