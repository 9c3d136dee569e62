"""The times that a student handed in: the grade of each, and what changed since the one before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

from grader.errors import RosgradeError
from grader.grading.files import RESULT_FILE
from grader.grading.last_attempt import EARLIER, keep_earlier
from grader.report.audience import for_student
from grader.report.model.class_row import for_class
from grader.report.model.result import read_result, result_json
from grader.report.model.result_model import AttemptPart, Result
from grader.report.text.last_save import change, changed_checks
from grader.spec.safe_text import one_line

MOST_KEPT = 20
"""Earlier results that stay in the folder of a report."""


def attempts_of(
    results: Sequence[Result], handed_in: Sequence[str] = (), counts: int = -1
) -> tuple[AttemptPart, ...]:
    """The attempts of a student; each with what a student may see of it beside it.

    Args:
        results: Of the same assignment, first to last.
        handed_in: When each was handed in, as in AttemptPart; by default when it was graded.
        counts: Index of the one that counts.
    """
    times = list(handed_in) or [result.started for result in results]
    copies = [for_student(result) for result in results]
    of_student: Sequence[AttemptPart | None] = [None] * len(results)
    if any(copy is not result for copy, result in zip(copies, results, strict=True)):
        of_student = attempts_of(copies, times, counts)
    return tuple(
        AttemptPart(
            sha256=result.submission.sha256,
            handed_in=times[index],
            score=result.score,
            max_score=result.max_score,
            counts=index == counts % len(results),
            changes=_changes(results[index - 1], result) if index else (),
            visible=of_student[index],
        )
        for index, result in enumerate(results)
    )


def with_history(folder: Path, result: Result) -> Result:
    """A new result with the attempts that were graded in the folder, and the hints opened there.

    Of a submission that was graded several times in a row only the last grade is an attempt, and
    what was graded with other checks is none. The result that lies in the folder becomes an
    earlier one; only the newest few stay, and of each only what :func:`attempts_of` needs.
    """
    file = folder / RESULT_FILE
    for replaced in _read([file]):
        if replaced.assignment.id == result.assignment.id:
            result = result.model_copy(update={"hints_opened": replaced.hints_opened})
        if replaced.submission.sha256 != result.submission.sha256:
            slim = for_class(replaced).model_copy(update={"attempts": ()})
            keep_earlier(file, result_json(slim))
    files = sorted((folder / EARLIER).glob("result-*.json"))
    for surplus in files[:-MOST_KEPT]:
        surplus.unlink(missing_ok=True)
    same_checks = [one for one in _read(files[-MOST_KEPT:]) if _kind(one) == _kind(result)]
    earlier = [
        before
        for before, after in pairwise([*same_checks, result])
        if before.submission.sha256 != after.submission.sha256
    ]
    attempts = attempts_of([*earlier, result]) if earlier else ()
    return result.model_copy(update={"attempts": attempts})


def _changes(before: Result, after: Result) -> tuple[str, ...]:
    """Which checks ended differently, a line each."""
    changed = changed_checks(before, after)
    return tuple(f"{one_line(new.title)}: {change(old, new)}" for old, new in changed)


def _kind(result: Result) -> tuple[str, frozenset[str]]:
    return result.assignment.id, frozenset(check.id for check in result.checks)


def _read(files: Sequence[Path]) -> Iterator[Result]:
    """Results of files; one that is missing or damaged is no attempt."""
    for file in files:
        with suppress(RosgradeError):
            yield read_result(file)
