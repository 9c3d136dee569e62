"""The student's copy of a result: nothing of a check that is not visible is left in it."""

from __future__ import annotations

from dataclasses import replace

from grader.assignment.model import Visibility, Withheld
from grader.checks.finding import Status
from grader.grade.first import every_point_judged, first_to_fix, reason
from grader.grade.model import CheckResult, Grade
from grader.grade.points import total
from grader.report.model.result_model import CheckPart, Result, WithheldPart


def for_student(result: Result) -> Result:
    """Leave out what a student does not get to see before grading.

    Checks that are not visible go with all that they say, scenarios that only they judged go
    with their recordings, and so do the tracebacks of checks that broke. Score and what to fix
    first are those of the visible checks; what is left of the rest is its number and its points.
    It is the result that :func:`~grader.assignment.selection.visible_part` gives.

    Args:
        result: The whole result; no visible check waits for one that is not.
    """
    visible = tuple(check for check in result.checks if _is_visible(check))
    hidden = [check for check in result.checks if not _is_visible(check)]
    if not hidden:
        return result
    judged = {item.scenario for check in visible for item in (check, *check.other_scenarios)}
    graded = every_point_judged(visible)
    return result.model_copy(
        update={
            "score": total(check.points for check in visible) if graded else None,
            "max_score": total(check.max_points for check in visible),
            "graded": graded,
            "first_to_fix": _first_to_fix(visible),
            "checks": tuple(_without_traceback(check) for check in visible),
            "withheld": WithheldPart(
                checks=result.withheld.checks + len(hidden),
                points=total((result.withheld.points, *(check.max_points for check in hidden))),
            ),
            "scenarios": tuple(one for one in result.scenarios if one.id in judged),
        }
    )


def grade_for_student(grade: Grade) -> Grade:
    """:func:`for_student` of a grade, from which the HTML report is made.

    Args:
        grade: The whole grade; no visible check waits for one that is not.
    """
    visible = [one for one in grade.results if one.visibility is Visibility.VISIBLE]
    hidden = [one for one in grade.results if one.visibility is not Visibility.VISIBLE]
    if not hidden:
        return grade
    shown = {one.id for one in visible}
    judged = {scenario for one in visible for scenario in one.scenarios}
    whole = grade.assignment
    assignment = whole.model_copy(
        update={
            "checks": tuple(spec for spec in whole.checks if spec.id in shown),
            "scenarios": tuple(one for one in whole.scenarios if one.id in judged),
        }
    )
    return replace(
        grade,
        assignment=assignment,
        results=tuple(_without_tracebacks(one) for one in visible),
        withheld=grade.withheld
        + Withheld(len(hidden), total(check.max_points for check in hidden)),
    )


def _first_to_fix(checks: tuple[CheckPart, ...]) -> str | None:
    """As :meth:`grader.grade.model.Grade.first_to_fix`."""
    failed = [check for check in checks if check.status is Status.FAILED]
    reasons = {
        check.id: reason(check.id, check.scenario, check.observed, check.evidence)
        for check in failed
    }
    return first_to_fix(
        reasons,
        [check.waits_for for check in checks],
        [check.id for check in checks if not check.max_points],
    )


def _without_traceback(check: CheckPart) -> CheckPart:
    """A traceback is for instructors, and quotes their own checks."""
    others = tuple(item.model_copy(update={"traceback": ""}) for item in check.other_scenarios)
    return check.model_copy(update={"traceback": "", "other_scenarios": others})


def _without_tracebacks(result: CheckResult) -> CheckResult:
    return replace(result, findings=tuple(replace(item, traceback="") for item in result.findings))


def _is_visible(check: CheckPart) -> bool:
    return check.visibility == Visibility.VISIBLE.value
