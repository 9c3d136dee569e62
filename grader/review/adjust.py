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
        _scored(one, written.manual.get(one.item or ""), review.key)
        for one in result.adjustments
        if one.kind == "manual"
    ]
    comments = [CommentPart(**one.model_dump()) for one in written.comments]
    for earlier in review.others_than(written, before):
        comments += [CommentPart(**one.model_dump(), earlier=True) for one in earlier.comments]
    causes = written.causes
    checks = (one.model_copy(update={"cause": causes.get(one.id, "")}) for one in result.checks)
    result = result.model_copy(update={"checks": tuple(checks)})
    points = (*manual, *_forgiven(result, of_class), *_given(result, written.given))
    if still_open(result.checks):
        graded = not still_open(result.checks, [one.check for one in written.given if one.instead])
        score = total(check.points for check in result.checks) if graded else None
        result = result.model_copy(update={"graded": graded, "score": score})
    return result.model_copy(update={"adjustments": points, "comments": tuple(comments)})


def _given(result: Result, given: Collection[Given]) -> Iterator[AdjustmentPart]:
    titles = {check.id: check.title for check in result.checks}
    left = {check.id for check in still_open(result.checks)}
    for one in given:
        title = titles.get(one.check or "", "Points by a person")
        if one.check in left or not one.instead:
            yield AdjustmentPart(kind="given", title=title, **one.model_dump())


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
