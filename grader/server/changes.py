"""What the pages of a review may change."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from grader.errors import UsageError
from grader.review.model import BankEntry, Comment, Forgiven, ManualScore, StudentReview
from grader.review.store import ReviewConflict
from grader.server.reviewed_class import ReviewedClass, ReviewedRow


def change_student(reviewed: ReviewedClass, row: ReviewedRow, sent: Any) -> None:
    """Change the review of a student as a page sent it, and write it.

    Raises:
        ReviewConflict: The page showed another version; nothing is written.
    """
    store, key = reviewed.store, row.entry.review_key
    if sent["do"] == "undo":
        store.undo(key, sent["version"])
        return
    review = store.student(key).content
    store.save(review.model_copy(update=_update(review, row, sent, reviewed.by)), sent["version"])
    if sent["do"] == "comment" and sent.get("index") is None:
        _count(reviewed, sent["text"])


def _update(review: StudentReview, row: ReviewedRow, sent: Any, by: str) -> dict[str, Any]:
    if sent["do"] == "score":
        return {"manual": dict(_scores(review, row, sent, by))}
    if sent["do"] == "notes":
        return {"notes": str(sent["notes"])}
    comments, index = list(review.comments), sent.get("index")
    if sent["do"] == "uncomment":
        del comments[index]
    elif sent["do"] == "comment":
        new = Comment(text=sent["text"], by=by, file=sent.get("file"), line=sent.get("line"))
        begin, end = (len(comments), None) if index is None else (index, index + 1)
        comments[begin:end] = [new]
    else:
        raise ValueError(sent["do"])
    return {"comments": tuple(comments)}


def _scores(
    review: StudentReview, row: ReviewedRow, sent: Any, by: str
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
    """Forgive a cause of failures, take that back, or comment it for all who have it."""
    check, cause, store = sent["check"], sent["cause"], reviewed.store
    found = [one for one in reviewed.clusters() if (one.check, one.cause) == (check, cause)]
    if not found:
        raise UsageError("Nobody fails for this cause any more. Load the page again.")
    if sent["do"] == "comment":
        comment = Comment(text=sent["text"], by=reviewed.by)
        rows = (row for row in reviewed.rows() if row.row.id in found[0].lost)
        for key in dict.fromkeys(row.entry.review_key for row in rows):
            saved = store.student(key)
            if comment.text not in (one.text for one in saved.content.comments):
                comments = (*saved.content.comments, comment)
                store.save(saved.content.model_copy(update={"comments": comments}), saved.version)
        _count(reviewed, comment.text)
        return
    if found[0].forgiven != sent["was"]:
        raise ReviewConflict("This was forgiven or taken back meanwhile. Load the page again.")
    now = store.of_class()
    kept = [one for one in now.content.forgiven if (one.check, one.cause) != (check, cause)]
    if sent["do"] == "forgive":
        share, reason = float(sent["share"]), str(sent["reason"])
        kept.append(Forgiven(check=check, cause=cause, share=share, reason=reason, by=reviewed.by))
    store.save(now.content.model_copy(update={"forgiven": tuple(kept)}), now.version)


def _count(reviewed: ReviewedClass, text: str) -> None:
    """Count the use of a comment in the bank, which holds the most used first."""
    saved = reviewed.store.of_class()
    times = Counter({one.text: one.used for one in saved.content.bank})
    times[text] += 1
    bank = tuple(BankEntry(text=known, used=count) for known, count in times.most_common())
    # Another reviewer may count at the same moment; that is worth no message.
    with suppress(ReviewConflict):
        reviewed.store.save(saved.content.model_copy(update={"bank": bank}), saved.version)
