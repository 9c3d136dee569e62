"""A grade as a short plain text, for a message or a comment to the student."""

from __future__ import annotations

from grader.findings.finding import Status
from grader.report.model.result_model import Result
from grader.report.text import additions, explanation
from grader.safe_text import clean, one_line


def summary(result: Result) -> str:
    """The score with its adjustments, what failed and why, and what persons wrote.

    Args:
        result: As far as the student may see it.
    """
    head = f"{one_line(result.assignment.id)}: {explanation.score(result)}"
    lines = [head, explanation.headline(result)]
    lines += [f"  {additions.line(one)}" for one in result.adjustments]
    blocks = ["\n".join(lines)]
    if result.submission.problem:
        blocks.append(f"It could not be read: {one_line(result.submission.problem)}")
    for check in (*result.of(Status.FAILED), *result.of(Status.ERROR)):
        lines = [f"{one_line(check.title)} ({explanation.points(check)} points)"]
        rows = explanation.explain(check, result)
        lines += [f"  {row.name}: {row.text}" for row in rows if row.name != "printed"]
        blocks.append("\n".join(lines))
    for comment in result.comments:
        where = additions.place(comment)
        who = f"{one_line(comment.by)}{f' ({where})' if where else ''}"
        blocks.append(f"{who}:\n{clean(comment.text)}")
    return "\n\n".join(blocks) + "\n"
