"""Changes to reviews, each as a new review."""

from __future__ import annotations

from grader.errors import UsageError
from grader.report.model.result_model import AdjustmentPart
from grader.review.model import (
    BankEntry,
    ClassReview,
    Comment,
    Forgiven,
    ManualScore,
    StudentReview,
)


def scored(
    review: StudentReview, item: AdjustmentPart, points: float | None, by: str, note: str
) -> StudentReview:
    """Give points for a manual item; None takes them back."""
    scores = {name: score for name, score in review.manual.items() if name != item.item}
    if points is not None:
        if not 0 <= points <= item.max_points:
            raise UsageError(f"{item.title}: give 0 to {item.max_points:g} points, not {points:g}")
        scores[item.item or ""] = ManualScore(points=points, by=by, note=note)
    return review.model_copy(update={"manual": scores})


def commented(review: StudentReview, comment: Comment, index: int | None = None) -> StudentReview:
    """Add a comment, or put it in the place of an earlier one."""
    comments = list(review.comments)
    if index is None:
        comments.append(comment)
    else:
        _refuse_unknown(review, index)
        comments[index] = comment
    return review.model_copy(update={"comments": tuple(comments)})


def uncommented(review: StudentReview, index: int) -> StudentReview:
    """Remove a comment."""
    _refuse_unknown(review, index)
    return review.model_copy(
        update={"comments": review.comments[:index] + review.comments[index + 1 :]}
    )


def noted(review: StudentReview, notes: str) -> StudentReview:
    """Replace the notes that only instructors see."""
    return review.model_copy(update={"notes": notes})


def used(review: ClassReview, text: str) -> ClassReview:
    """Count the use of a comment in the bank, which holds the most used first."""
    times = {one.text: one.used for one in review.bank}
    times[text] = times.get(text, 0) + 1
    entries = (BankEntry(text=known, used=count) for known, count in times.items())
    return review.model_copy(update={"bank": tuple(sorted(entries, key=lambda one: -one.used))})


def forgiven(review: ClassReview, check: str, cause: str, now: Forgiven | None) -> ClassReview:
    """Forgive a cause of failures, or with None take that back."""
    others = (one for one in review.forgiven if (one.check, one.cause) != (check, cause))
    return review.model_copy(update={"forgiven": (*others, *([now] if now else []))})


def _refuse_unknown(review: StudentReview, index: int) -> None:
    if not 0 <= index < len(review.comments):
        raise UsageError("this comment is not there any more")
