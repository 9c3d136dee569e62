"""What the pages of a review may change."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator
from contextlib import suppress
from typing import Any

from grader.errors import UsageError
from grader.grade.model import still_open
from grader.review.model import (
    AttemptReview,
    BankEntry,
    Comment,
    Forgiven,
    Given,
    ManualScore,
    StudentReview,
)
from grader.review.store import ReviewConflict, Saved
from grader.server.reviewed_class import ReviewedClass, ReviewedRow

_POINTS = ("score", "give", "take", "settle")
"""Changes of points, which are those of the attempt that counts."""


def change_student(reviewed: ReviewedClass, row: ReviewedRow, sent: Any) -> None:
    """Change the review of a student as a page sent it, and write it.

    Raises:
        ReviewConflict: The page showed another version; nothing is written.
    """
    store, key = reviewed.store, row.entry.review_key
    if sent.get("attempt", row.attempt) != row.attempt:
        raise ReviewConflict("The student handed in again meanwhile. Load the page again.")
    if sent["do"] == "undo":
        store.undo(key, sent["version"])
        return
    review = store.student(key).content
    if sent["do"] in _POINTS:
        row = reviewed.counted(row)
    if sent["do"] == "settle":
        given = (*review.of(row.attempt).given, *_settled(row, reviewed.by))
        changed = review.about(row.attempt, given=given)
    elif sent["do"] == "notes":
        changed = review.model_copy(update={"notes": str(sent["notes"])})
    elif sent["do"] == "score":
        now = review.of(row.attempt)
        changed = review.about(row.attempt, manual=dict(_scores(now, row, sent, reviewed.by)))
    else:
        update = _update(review.of(row.attempt), row, sent, reviewed.by)
        changed = review.about(row.attempt, **update)
    store.save(changed, sent["version"])
    if sent["do"] == "comment" and sent.get("index") is None:
        _count(reviewed, sent["text"])


def _settled(row: ReviewedRow, by: str) -> Iterator[Given]:
    """The points of what could not be judged, so that there is a grade without it."""
    for check in row.row.result.open if row.row.result else ():
        reason = "could not be judged, through no fault of yours"
        yield Given(points=check.max_points, reason=reason, by=by, check=check.id, instead=True)


def _update(review: AttemptReview, row: ReviewedRow, sent: Any, by: str) -> dict[str, Any]:
    if sent["do"] == "give":
        return {"given": (*review.given, _given(row, sent, by))}
    index = sent.get("index")
    if sent["do"] == "take":
        given = [points for at, points in enumerate(review.given) if at != index]
        return {"given": tuple(given)}
    comments = list(review.comments)
    if index is not None and index not in range(len(comments)):
        raise IndexError(index)
    if sent["do"] == "uncomment":
        del comments[index]
    elif sent["do"] == "comment":
        comment = Comment(text=sent["text"], by=by, file=sent.get("file"), line=sent.get("line"))
        if index is None:
            comments.append(comment)
        else:
            comments[index] = comment
    else:
        raise ValueError(sent["do"])
    return {"comments": tuple(comments)}


def _given(row: ReviewedRow, sent: Any, by: str) -> Given:
    points, check = float(sent["points"]), sent.get("check") or None
    unjudged = still_open(row.row.result.checks) if row.row.result else ()
    # What is judged in the end must not count twice; a deduction is about something else.
    instead = points >= 0 and check in {one.id for one in unjudged}
    return Given(points=points, reason=str(sent["reason"]), by=by, check=check, instead=instead)


def _scores(
    review: AttemptReview, row: ReviewedRow, sent: Any, by: str
) -> Iterator[tuple[str, ManualScore]]:
    item, points = sent["item"], sent["points"]
    adjustments = row.row.result.adjustments if row.row.result else ()
    most = {one.item: one.max_points for one in adjustments}.get(item)
    if most is None:
        raise UsageError(f"{item}: is no item of this assignment any more")
    yield from ((name, score) for name, score in review.manual.items() if name != item)
    if points is not None:
        if not 0 <= float(points) <= most:
            raise UsageError(f"Give 0 to {most:g} points, not {float(points):g}.")
        yield item, ManualScore(points=float(points), by=by, note=str(sent["note"]))


def change_cluster(reviewed: ReviewedClass, sent: Any) -> None:
    """Forgive a cause of failures, take that back, comment it for all who have it, or split it."""
    check, cause, store = sent["check"], sent["cause"], reviewed.store
    clusters = {(cluster.check, cluster.cause): cluster for cluster in reviewed.clusters()}
    cluster = clusters.get((check, cause))
    if cluster is None:
        raise UsageError("Nobody fails for this cause any more. Load the page again.")
    if sent["do"] == "comment":
        comment = Comment(text=sent["text"], by=reviewed.by)
        for saved, attempt in _reviews(reviewed, cluster.lost):
            comments = saved.content.of(attempt).comments
            if comment.text not in (one.text for one in comments):
                changed = saved.content.about(attempt, comments=(*comments, comment))
                store.save(changed, saved.version)
        _count(reviewed, comment.text)
        return
    if sent["do"] == "split":
        name = str(sent["name"]).strip()
        for saved, attempt in _reviews(reviewed, cluster.lost.keys() & sent["students"]):
            causes = {**saved.content.of(attempt).causes, check: name}
            if not name:
                del causes[check]
            store.save(saved.content.about(attempt, causes=causes), saved.version)
        return
    if cluster.forgiven != sent["was"]:
        raise ReviewConflict("This was forgiven or taken back meanwhile. Load the page again.")
    now = store.of_class()
    kept = [one for one in now.content.forgiven if (one.check, one.cause) != (check, cause)]
    if sent["do"] == "forgive":
        share, reason = float(sent["share"]), str(sent["reason"])
        kept.append(Forgiven(check=check, cause=cause, share=share, reason=reason, by=reviewed.by))
    store.save(now.content.model_copy(update={"forgiven": tuple(kept)}), now.version)


def _reviews(
    reviewed: ReviewedClass, keys: Container[str]
) -> Iterator[tuple[Saved[StudentReview], str]]:
    """The review of each student or team, with the attempt that is in the class."""
    rows = {row.entry.review_key: row for row in reviewed.rows() if row.row.id in keys}
    for key, row in rows.items():
        yield reviewed.store.student(key), row.attempt


def _count(reviewed: ReviewedClass, text: str) -> None:
    """Count the use of a comment in the bank, which holds the most used first."""
    saved = reviewed.store.of_class()
    times = Counter({one.text: one.used for one in saved.content.bank})
    times[text] += 1
    bank = tuple(BankEntry(text=known, used=count) for known, count in times.most_common())
    # Another reviewer may count at the same moment; that is worth no message.
    with suppress(ReviewConflict):
        reviewed.store.save(saved.content.model_copy(update={"bank": bank}), saved.version)
