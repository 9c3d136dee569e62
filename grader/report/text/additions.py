"""What persons and the rules of the course add to a result, as plain words."""

from __future__ import annotations

from grader.report.model.result_model import AdjustmentPart, CommentPart, Result
from grader.report.text.words import counted_points, number
from grader.spec.safe_text import one_line


def line(one: AdjustmentPart) -> str:
    """``README: 1.5 of 2 points, by AB``, ``forgiven: Period: +2 points, by AB: our typo``."""
    title = f"{'forgiven: ' if one.kind == 'forgiven' else ''}{one_line(one.title)}"
    if one.points is None:
        return f"{title}: waits for a person ({counted_points(one.max_points)})"
    points = f"{number(one.points)} of {counted_points(one.max_points)}"
    if one.kind != "manual":
        sign = "−" if one.points < 0 else "+"
        points = f"{sign}{counted_points(abs(one.points))}"
    by = f", by {one_line(one.by)}" if one.by else ""
    reason = f": {one_line(one.reason)}" if one.reason else ""
    return f"{title}: {points}{by}{reason}"


def place(comment: CommentPart) -> str:
    """``file:line`` of a comment, ``file``, or nothing; of an earlier attempt it says so."""
    parts = (comment.file or "", str(comment.line) if comment.file and comment.line else "")
    where = one_line(":".join(filter(None, parts)))
    return " of ".join(filter(None, (where, "an earlier attempt" if comment.earlier else "")))


def comment_line(comment: CommentPart) -> str:
    """A comment in one line, with the initials of its writer."""
    where = place(comment)
    return f"{one_line(comment.by)}{f' ({where})' if where else ''}: {one_line(comment.text)}"


def waiting(result: Result) -> str:
    """``README (2 points) waits for a person``, or nothing."""
    items = [
        f"{one_line(one.title)} ({counted_points(one.max_points)})"
        for one in result.adjustments
        if one.points is None
    ]
    return f"{', '.join(items)} wait{'s' if len(items) == 1 else ''} for a person" if items else ""
