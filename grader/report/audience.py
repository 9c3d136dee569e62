"""Who reads a result, and what is left of it for that reader."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import wraps
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from grader.assignment.model import Visibility
from grader.grade.model import still_open, total
from grader.report.model.mistakes import first_to_fix
from grader.report.model.result_model import AdjustmentPart, CheckPart, Result, WithheldPart
from grader.spec.safe_text import clean

VISIBLE_ONLY = frozenset({Visibility.VISIBLE.value})


def for_student(result: Result, shown: frozenset[str] = VISIBLE_ONLY) -> Result:
    """Leave out what a student does not get to see before grading.

    Checks that are not visible go with all that they say, and so do scenarios that only they
    judged, the files of recordings, and the tracebacks of checks that broke. Score and what to
    fix first are those of the visible checks; what is left of the rest is its number and its
    points. It is the result that :func:`~grader.assignment.selection.visible_part` gives.

    Args:
        result: The whole result; no visible check waits for one that is not.
        shown: The visibilities that the student gets to see by now.
    """
    visible = [check for check in result.checks if check.visibility in shown]
    hidden = [check for check in result.checks if check.visibility not in shown]
    ids = {None, *(check.id for check in visible)}
    if not hidden:
        return result
    judged = {item.scenario for check in visible for item in check.findings}
    graded = not still_open(visible, result.settled)
    copy = result.model_copy(
        update={
            "score": total(check.points for check in visible) if graded else None,
            "max_score": total(check.max_points for check in visible),
            "graded": graded,
            "first_to_fix": first_to_fix(visible),
            "checks": tuple(map(_without_traceback, visible)),
            "withheld": WithheldPart(
                checks=result.withheld.checks + len(hidden),
                points=total((result.withheld.points, *(check.max_points for check in hidden))),
            ),
            "scenarios": tuple(
                run.model_copy(update={"recording": None})
                for run in result.scenarios
                if run.id in judged
            ),
            "adjustments": tuple(one for one in result.adjustments if one.check in ids),
            "attempts": tuple(one.visible for one in result.attempts if one.visible),
        }
    )
    adjustments = (_as_visible(one, copy) for one in copy.adjustments)
    return copy.model_copy(update={"adjustments": tuple(adjustments)})


def _as_visible(one: AdjustmentPart, copy: Result) -> AdjustmentPart:
    """An adjustment for a student's copy: another attempt counts there by its visible points."""
    counts = next((each.score for each in copy.attempts if each.counts), None)
    if one.kind != "attempts":
        return one
    points = 0.0 if counts is None or copy.score is None else counts - copy.score
    return one.model_copy(update={"points": points, "reason": ""})


def _without_traceback(check: CheckPart) -> CheckPart:
    """A check without its traceback, which is for instructors and quotes their own checks."""
    others = tuple(item.model_copy(update={"traceback": ""}) for item in check.other_scenarios)
    return check.model_copy(update={"traceback": "", "other_scenarios": others})


F = TypeVar("F", bound=Callable[..., Any])


class Audience(str, Enum):
    """Who reads a format."""

    STUDENT = "student"
    """Hidden checks are left out."""
    INSTRUCTOR = "instructor"


RENDERERS: dict[Callable[..., Any], Audience] = {}
"""Every function that writes a result, as its caller sees it."""


def written_for(audience: Audience) -> Callable[[F], F]:
    """Decorator: what a format gets is what its audience may see, with clean text."""

    def declare(render: F) -> F:
        @wraps(render)
        def rendered(result: Result, *args: Any, **kwargs: Any) -> Any:
            seen = for_student(result) if audience is Audience.STUDENT else result
            return render(_cleaned(seen), *args, **kwargs)

        RENDERERS[rendered] = audience
        return cast(F, rendered)

    return declare


def _cleaned(value: Any) -> Any:
    """The same without what acts on a screen, or is no text to a reader of XML."""
    if isinstance(value, str) and not isinstance(value, Enum):
        return clean(value)
    if isinstance(value, tuple):
        return tuple(map(_cleaned, value))
    if isinstance(value, dict):
        return {_cleaned(name): _cleaned(item) for name, item in value.items()}
    if isinstance(value, BaseModel):
        inner = {name: _cleaned(getattr(value, name)) for name in type(value).model_fields}
        return value.model_copy(update=inner)
    if is_dataclass(value) and not isinstance(value, type):
        return replace(
            value, **{one.name: _cleaned(getattr(value, one.name)) for one in fields(value)}
        )
    return value
