"""What the pages of a review may change."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from grader.errors import UsageError
from grader.review.model import (
    BankEntry,
    ClassReview,
    Comment,
    Forgiven,
    ManualScore,
    StudentReview,
)
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
    update = _UPDATES[sent["do"]](store.student(key).content, row, sent, reviewed.by)
    store.save(store.student(key).content.model_copy(update=update), sent["version"])
    if sent["do"] == "comment" and sent.get("index") is None:
        _count(reviewed, sent["text"])


def _score(review: StudentReview, row: ReviewedRow, sent: Any, by: str) -> dict[str, Any]:
    adjustments = row.row.result.adjustments if row.row.result else ()
    most = next((one.max_points for one in adjustments if one.item == sent["item"]), None)
    if most is None:
        raise UsageError(f"{sent['item']}: is no item of this assignment any more")
    scores = {name: score for name, score in review.manual.items() if name != sent["item"]}
    if sent["points"] is not None:
        points = float(sent["points"])
        if not 0 <= points <= most:
            raise UsageError(f"Give 0 to {most:g} points, not {points:g}.")
        scores[sent["item"]] = ManualScore(points=points, by=by, note=str(sent["note"]))
    return {"manual": scores}


def _comment(review: StudentReview, _: ReviewedRow, sent: Any, by: str) -> dict[str, Any]:
    new = Comment(text=sent["text"], by=by, file=sent.get("file"), line=sent.get("line"))
    index, old = sent.get("index"), review.comments
    if index is None:
        return {"comments": (*old, new)}
    return {"comments": (*old[: int(index)], new, *old[int(index) + 1 :])}


def _uncomment(review: StudentReview, _: ReviewedRow, sent: Any, by: str) -> dict[str, Any]:
    index = int(sent["index"])
    return {"comments": (*review.comments[:index], *review.comments[index + 1 :])}


def _notes(_: StudentReview, __: ReviewedRow, sent: Any, by: str) -> dict[str, Any]:
    return {"notes": str(sent["notes"])}


_UPDATES = {"score": _score, "comment": _comment, "uncomment": _uncomment, "notes": _notes}


def change_cluster(reviewed: ReviewedClass, sent: Any) -> None:
    """Forgive a cause of failures, take that back, or comment it for all who have it."""
    check, cause, store = sent["check"], sent["cause"], reviewed.store
    found = [one for one in reviewed.clusters() if (one.check, one.cause) == (check, cause)]
    if not found:
        raise UsageError("Nobody fails for this cause any more. Load the page again.")
    if sent["do"] == "comment":
        comment = Comment(text=sent["text"], by=reviewed.by)
        rows = (row for row in reviewed.rows() if row.row.id in found[0].keys)
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
    times = {one.text: one.used for one in saved.content.bank}
    times[text] = times.get(text, 0) + 1
    bank = sorted(times.items(), key=lambda one: -one[1])
    entries = tuple(BankEntry(text=known, used=count) for known, count in bank)
    changed: ClassReview = saved.content.model_copy(update={"bank": entries})
    # Another reviewer may count at the same moment; that is worth no message.
    with suppress(ReviewConflict):
        reviewed.store.save(changed, saved.version)
