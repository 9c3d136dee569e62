"""The grades of a class as CSV, and how text is written into CSV so that it stays text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from grader.errors import UsageError
from grader.findings.finding import Status
from grader.grade.model import total
from grader.report.model.class_row import ClassRow, RowStatus
from grader.report.model.result_model import AdjustmentPart, Result
from grader.report.text.words import number
from grader.spec.safe_text import one_line

# Some spreadsheets take the wide forms of East Asian keyboards for the same.
_FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
_TO_QUOTE = re.compile(r'[",;\t\r\n]')


def grades_csv(rows: Sequence[ClassRow]) -> str:
    """The gradebook of a class as CSV: a row for each submission, a column for each check.

    Then come a column for each manual item and one for each other kind of adjustment that there is.
    What could not be judged is an empty cell, and so is the score of a row without a grade.
    """
    results = [row.result for row in rows if row.result is not None]
    if results:
        common_assignment(results)
    max_points: dict[str, float] = {}
    adjustment_titles: dict[str, str] = {}
    for result in results:
        for check in result.checks:
            max_points.setdefault(check.id, check.max_points)
        for adjustment in result.adjustments:
            adjustment_titles.setdefault(*_column_of(adjustment))
    header = [
        *("submission", "name", "late", "status", "score", "max_score", "graded"),
        *(f"{check} ({number(most)})" for check, most in max_points.items()),
        *adjustment_titles.values(),
        "note",
    ]
    table = [header]
    for row in rows:
        earned = {c.id: number(c.points) for c in row.judged if c.status is not Status.ERROR}
        added = _points_added(row)
        table.append(
            [
                cell(row.id),
                cell(row.name),
                "yes" if row.late else "",
                row.status.value,
                "" if row.score is None else number(row.score),
                number(row.result.final_max_score) if row.result is not None else "",
                "yes" if row.graded else "no",
                *(earned.get(check, "") for check in max_points),
                *(number(added[key]) if key in added else "" for key in adjustment_titles),
                cell(row.note),
            ]
        )
    return csv_text(table)


def _points_added(row: ClassRow) -> dict[str, float]:
    """The points of each column of adjustments, by its key."""
    points: dict[str, float] = {}
    if row.result is not None and row.judged:
        for adjustment in row.result.adjustments:
            if adjustment.points is not None:
                key, _ = _column_of(adjustment)
                points[key] = total((points.get(key, 0.0), adjustment.points))
    return points


def _column_of(adjustment: AdjustmentPart) -> tuple[str, str]:
    """The key and the title of the column of an adjustment."""
    if adjustment.kind != "manual":
        # The column `late` says yes or no.
        return adjustment.kind, f"{adjustment.kind} points"
    item = adjustment.item
    return f"manual {item}", f"{item} ({number(adjustment.max_points)})"


def csv_text(rows: Iterable[Sequence[str]]) -> str:
    """Rows as CSV (RFC 4180).

    A cell with another separator is quoted too: where the decimal mark is a comma, spreadsheets
    separate by semicolons.
    """
    return "".join(f"{','.join(map(_quoted, row))}\r\n" for row in rows)


def _quoted(text: str) -> str:
    doubled = text.replace('"', '""')
    return f'"{doubled}"' if _TO_QUOTE.search(text) else text


def cell(text: str) -> str:
    """Text for a cell in one line, which no spreadsheet takes for a formula.

    Source: OWASP, "CSV Injection".
    """
    line = one_line(text)
    return f"'{line}" if line.lstrip().startswith(_FORMULA) else line


def why_no_score(row: ClassRow) -> str:
    """Why a row has no score, in a few words."""
    if row.status is RowStatus.MISSING:
        return "handed in nothing"
    if row.status is RowStatus.WAITING:
        return f"waits for a person ({', '.join(map(one_line, row.waits_for))})"
    problem = row.result.submission.problem if row.result is not None else None
    return "not graded" if problem is None else f"unreadable ({one_line(problem)})"


def common_assignment(results: Sequence[Result]) -> str:
    """The id of the assignment that all results are of."""
    names = sorted({result.assignment.id for result in results})
    if not names:
        raise UsageError("there is no result to write")
    if len(names) > 1:
        raise UsageError(f"results of several assignments: {', '.join(names)}")
    return names[0]
