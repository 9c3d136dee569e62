"""The files about a whole class: the gradebook and the overview."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from grader.batch.batch import Done
from grader.batch.ledger import BATCH_FILE, Entry, Ledger
from grader.errors import UsageError
from grader.findings.finding import Status
from grader.findings.words import listing
from grader.grade.model import total
from grader.gradebook.adjusting import ClassAdjustments
from grader.grading.files import REPORT_FILE, RESULT_FILE
from grader.report.files import write_whole
from grader.report.formats.gradebook import grades_csv
from grader.report.html.overview import render_overview
from grader.report.model.class_row import ClassRow, for_class
from grader.report.model.cluster import clusters
from grader.report.model.result import read_result
from grader.report.model.result_model import Result
from grader.report.text.words import counted_points
from grader.review.store import ReviewStore
from grader.spec.safe_text import one_line

GRADES_FILE = "grades.csv"
OVERVIEW_FILE = "index.html"
INSTRUCTOR_FOLDER = "instructor"
NO_RESULT = "not graded yet; run the batch again"
_MOST_TWINS = 5


def copies(done: Sequence[Done]) -> int:
    """How many submissions are the same as another one; what a team shares is one."""
    return sum(len({_owner(entry) for entry in same}) - 1 for same in _same(done).values())


def _same(done: Sequence[Done]) -> dict[str, list[Entry]]:
    """Rows by the key of the one that was graded for all with the same submission."""
    same: dict[str, list[Entry]] = defaultdict(list)
    for row in done:
        same[row.entry.original].append(row.entry)
    return same


def _owner(entry: Entry) -> str:
    """Key of the student or the team whose work a row is."""
    return entry.attempt_of or entry.team or entry.key


def _note(done: Done, same: Sequence[Entry]) -> str:
    """What the instructor should know of a row.

    Args:
        same: All rows with the same submission.
    """
    notes = [done.entry.fault or done.entry.problem, _twins(done.entry, same)]
    result = done.result
    if result is not None and result.submission.problem:
        notes.append(result.submission.problem)
    if result is not None and not result.graded:
        errors = (check.observed for check in result.checks if check.status is Status.ERROR)
        points = counted_points(total(check.max_points for check in result.open))
        notes.append(f"not graded, {points} open: {one_line(next(errors, ''))}")
    return "; ".join(note for note in notes if note)


def _twins(entry: Entry, same: Sequence[Entry]) -> str:
    """Who else handed in the same; a class of 500 needs no 500 names on each row."""
    others = [other.key for other in same if _owner(other) != _owner(entry)]
    if not others:
        return ""
    names, unnamed = others[:_MOST_TWINS], len(others[_MOST_TWINS:])
    if unnamed:
        names.append(f"{unnamed} {'other' if unnamed == 1 else 'others'}")
    return f"the same submission as {listing(names)}"


def standing(ledger: Ledger, entry: Entry) -> Done:
    """A row of a batch with the result in the batch's folder."""
    result = ledger.result(entry.key) if not entry.fault else None
    if result is not None and entry.sha256 == result.submission.sha256:
        return Done(entry, result, fresh=False)
    if entry.sha256 and not entry.fault:
        entry = entry.with_problem(NO_RESULT)
    return Done(entry, None, fresh=False)


def all_standing(ledger: Ledger) -> list[Done]:
    """The rows of a batch as they are now."""
    return [standing(ledger, entry) for entry in ledger.read().entries]


def class_rows(
    done: Sequence[Done], ledger: Ledger | None = None, *, attempts: bool = False
) -> list[ClassRow]:
    """The rows of a class as the overview shows them, sorted by key; ``attempts``: earlier too."""
    same = _same(done)
    rows = [row for row in done if attempts or not row.entry.attempt_of]
    return [
        ClassRow(
            id=row.entry.key,
            name=row.entry.name,
            report=_report(row, ledger),
            result=row.result,
            note=_note(row, same[row.entry.original]),
            late=row.entry.late or _is_late(row.result),
            missing=not (row.entry.sha256 or row.entry.fault),
        )
        for row in sorted(rows, key=lambda row: row.entry.key)
    ]


def _is_late(result: Result | None) -> bool:
    return result is not None and any(one.kind == "late" for one in result.adjustments)


def _report(done: Done, ledger: Ledger | None) -> str | None:
    if ledger is None or done.result is None:
        return None
    return os.path.relpath(ledger.folder(done.entry.key) / REPORT_FILE, ledger.out)


def write_class(done: Sequence[Done], ledger: Ledger) -> Path:
    """Write the gradebook and the overview, with links to the pages for the instructor."""
    rows = class_rows(done, ledger)
    write_whole(ledger.out / GRADES_FILE, grades_csv(rows))
    overview = ledger.out / OVERVIEW_FILE
    store = ReviewStore(ledger.out)
    causes = clusters(rows, store.of_class().content.shares)
    vanished = store.vanished({row.entry.review_key for row in done})
    pages = sorted(file.name for file in (ledger.out / INSTRUCTOR_FOLDER).glob("*.html"))
    write_whole(overview, render_overview(rows, causes, vanished, pages))
    return overview


def find_reports(out: Path) -> tuple[Path, ...]:
    """The report folders at a path: itself, or those of a class in it, sorted.

    Hidden folders are left out: a batch that still runs writes in them. So are reports of rows
    that the batch no longer has, and of earlier submissions.
    """
    if not out.exists():
        raise UsageError(f"{out}: does not exist")
    if (out / RESULT_FILE).is_file():
        return (out,)
    if (out / BATCH_FILE).is_file():
        ledger = Ledger(out)
        graded = [row.entry.key for row in all_standing(ledger) if row.result is not None]
        if not graded:
            raise UsageError(f"{out}: nothing of this batch is graded yet")
        return tuple(sorted(ledger.folder(key) for key in graded))
    folders = sorted(file.parent.relative_to(out) for file in out.rglob(RESULT_FILE))
    reports = tuple(out / folder for folder in folders if "/." not in f"/{folder}")
    if not reports:
        raise UsageError(f"{out}: there is no {RESULT_FILE} in it or in a folder below it")
    return reports


def read_class(out: Path) -> list[ClassRow]:
    """The rows of the class at a path; of a folder of single reports, a row for each."""
    if (out / BATCH_FILE).is_file():
        ledger = Ledger(out)
        adjust = ClassAdjustments(ledger)
        return class_rows([adjust.row(row) for row in all_standing(ledger)], ledger)
    results = (for_class(read_result(folder / RESULT_FILE)) for folder in find_reports(out))
    return class_rows([Done(Entry(one.submission.id), one, fresh=False) for one in results])
