"""A result with what persons and the rules of the course add to it."""

from __future__ import annotations

from collections.abc import Iterator

from grader.errors import UsageError
from grader.findings.finding import Status
from grader.grade.model import points_for, total
from grader.report.model.cause import cause
from grader.report.model.result_model import AdjustmentPart, CommentPart, Result
from grader.review.model import ClassReview, ManualScore, StudentReview


def adjusted(
    result: Result,
    review: StudentReview,
    of_class: ClassReview,
) -> Result:
    """A result with the points, comments and deductions as they are written down now.

    They replace those that the result has, so doing it twice is the same as once; ``score`` and
    the checks stay as they are. The manual items are those of the result: what a review says of
    an item that the assignment does not have any more is left out.

    A forgiven check gets back what it lost itself. A check that waited for it gets nothing: it was
    never judged, and would perhaps have failed.

    Raises:
        UsageError: A manual item has more points than it can give.
    """
    manual = [
        _scored(one, review.manual.get(one.item or ""), review.key)
        for one in result.adjustments
        if one.kind == "manual"
    ]
    comments = (CommentPart(**one.model_dump()) for one in review.comments)
    return result.model_copy(
        update={
            "adjustments": (*manual, *_forgiven(result, of_class)),
            "comments": tuple(comments),
        }
    )


def _scored(item: AdjustmentPart, score: ManualScore | None, key: str) -> AdjustmentPart:
    if score is None:
        return item.model_copy(update={"points": None, "by": "", "reason": ""})
    if score.points > item.max_points:
        raise UsageError(
            f"the review of {key}: manual.{item.item}: has {score.points:g} points, "
            f"but at most {item.max_points:g} are possible"
        )
    return item.model_copy(update={"points": score.points, "by": score.by, "reason": score.note})


def _forgiven(result: Result, of_class: ClassReview) -> Iterator[AdjustmentPart]:
    known = {(one.check, one.cause): one for one in of_class.forgiven}
    for check in result.of(Status.FAILED):
        found = known.get((check.id, cause(check)))
        if found is not None:
            lost = total((check.max_points, -check.points))
            yield AdjustmentPart(
                kind="forgiven",
                title=check.title,
                points=points_for(lost, found.share),
                reason=found.reason,
                by=found.by,
                check=check.id,
            )
