"""A result with what persons and the rules of the course add to it."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from grader.errors import UsageError
from grader.findings.finding import Status
from grader.grade.model import points_for, still_open, total
from grader.report.model.cluster import cause
from grader.report.model.result_model import AdjustmentPart, CommentPart, Result
from grader.review.model import ClassReview, Given, ManualScore, StudentReview


def adjusted(
    result: Result,
    review: StudentReview,
    of_class: ClassReview,
    before: Collection[str] = (),
) -> Result:
    """A result with the points, comments and deductions as they are written down now.

    They replace those that the result has, so doing it twice is the same as once; the checks stay
    as they are. Where points of a person stand for each that could not be judged, there is a score.
    The manual items are those of the result: what a review says of an item that the assignment
    does not have any more is left out.

    A forgiven check gets back what it lost itself. A check that waited for it gets nothing: it was
    never judged, and would perhaps have failed.

    Args:
        before: Hashes of the student's earlier attempts, whose comments are shown as such.

    Raises:
        UsageError: A manual item has more points than it can give.
    """
    written = review.of(result.submission.sha256)
    manual = [
        _scored(item, written.manual.get(item.item or ""), review.key)
        for item in result.adjustments
        if item.kind == "manual"
    ]
    comments = [CommentPart(**comment.model_dump()) for comment in written.comments]
    for earlier in review.others_than(written, before):
        for comment in earlier.comments:
            comments.append(CommentPart(**comment.model_dump(), earlier=True))
    checks = [
        check.model_copy(update={"cause": written.causes.get(check.id, "")})
        for check in result.checks
    ]
    result = result.model_copy(update={"checks": tuple(checks)})
    points = (*manual, *_forgiven(result, of_class), *_given(result, written.given))
    if still_open(result.checks):
        judged_by_person = [given.check for given in written.given if given.instead]
        graded = not still_open(result.checks, judged_by_person)
        score = total(check.points for check in result.checks) if graded else None
        result = result.model_copy(update={"graded": graded, "score": score})
    return result.model_copy(update={"adjustments": points, "comments": tuple(comments)})


def _given(result: Result, given: Collection[Given]) -> Iterator[AdjustmentPart]:
    titles = {check.id: check.title for check in result.checks}
    unjudged = {check.id for check in still_open(result.checks)}
    for points in given:
        title = titles.get(points.check or "", "Points by a person")
        # What stands for a judgement counts only as long as there is none.
        if points.check in unjudged or not points.instead:
            yield AdjustmentPart(kind="given", title=title, **points.model_dump())


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
    forgiven = {(one.check, one.cause): one for one in of_class.forgiven}
    for check in result.of(Status.FAILED):
        of_check = forgiven.get((check.id, cause(check)))
        if of_check is not None:
            lost = total((check.max_points, -check.points))
            yield AdjustmentPart(
                kind="forgiven",
                title=check.title,
                points=points_for(lost, of_check.share),
                reason=of_check.reason,
                by=of_check.by,
                check=check.id,
            )
