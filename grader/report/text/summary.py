"""A grade as a short plain text, for a message or a comment to the student."""

from __future__ import annotations

from collections.abc import Iterator

from grader.findings.finding import Status
from grader.report.model.result_model import CommentPart, Result
from grader.report.text import explanation
from grader.report.text.words import counted_points, number
from grader.safe_text import clean, one_line


def summary(result: Result) -> str:
    """The score with its adjustments, what failed and why, and what persons wrote.

    Args:
        result: As far as the student may see it.
    """
    blocks = ["\n".join(_score(result))]
    if result.submission.problem:
        blocks.append(f"It could not be read: {one_line(result.submission.problem)}")
    for check in (*result.of(Status.FAILED), *result.of(Status.ERROR)):
        lines = [f"{one_line(check.title)} ({explanation.points(check)} points)"]
        rows = explanation.explain(check, result)
        lines += [f"  {row.name}: {row.text}" for row in rows if row.name != "printed"]
        blocks.append("\n".join(lines))
    blocks += map(_comment, result.comments)
    return "\n\n".join(blocks) + "\n"


def _score(result: Result) -> Iterator[str]:
    whole = counted_points(result.final_max_score)
    points = "not graded yet" if result.final_score is None else number(result.final_score)
    yield f"{one_line(result.assignment.id)}: {points} of {whole}"
    yield explanation.headline(result)
    if result.adjustments:
        yield f"  {number(result.score or 0.0)}: the checks"
    for one in result.adjustments:
        words = [one.title, *filter(None, (one.reason, one.by and f"by {one.by}"))]
        given = "waits for a person" if one.points is None else f"{one.points:+.10g}"
        yield f"  {given}: {one_line(', '.join(words))}"


def _comment(comment: CommentPart) -> str:
    place = f" at {comment.file}" if comment.file else ""
    place += f":{comment.line}" if comment.file and comment.line else ""
    return f"{one_line(f'{comment.by}{place}')}:\n{clean(comment.text)}"
