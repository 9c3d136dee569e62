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
    return sum(len(set(map(_hand, same))) - 1 for same in _same(done).values())


def _same(done: Sequence[Done]) -> dict[str, list[Entry]]:
    """Rows by the key of the one that was graded for all with the same submission."""
    same: dict[str, list[Entry]] = defaultdict(list)
    for item in done:
        same[item.entry.original].append(item.entry)
    return same


def _hand(entry: Entry) -> str:
    return entry.attempt_of or entry.team or entry.key


def _note(done: Done, same: Sequence[Entry]) -> str:
    parts = [done.entry.fault or done.entry.problem]
    others = [entry.key for entry in same if _hand(entry) != _hand(done.entry)]
    if others:
        # A class of 500 that handed in the starter package needs no 500 names on each row.
        twins = others[:_MOST_TWINS]
        left = len(others) - len(twins)
        named = [*twins, f"{left} {'other' if left == 1 else 'others'}"] if left else twins
        parts.append(f"the same submission as {listing(named)}")
    if done.result is not None and done.result.submission.problem:
        parts.append(done.result.submission.problem)
    if done.result is not None and not done.result.graded:
        errors = (one.observed for one in done.result.checks if one.status is Status.ERROR)
        still = counted_points(total(one.max_points for one in done.result.open))
        parts.append(f"not graded, {still} open: {one_line(next(errors, ''))}")
    return "; ".join(part for part in parts if part)


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
    own = (item for item in done if attempts or not item.entry.attempt_of)
    rows = sorted(own, key=lambda item: item.entry.key)
    return [
        ClassRow(
            id=item.entry.key,
            name=item.entry.name,
            report=_report(item, ledger),
            result=item.result,
            note=_note(item, same[item.entry.original]),
            late=item.entry.late or _is_late(item.result),
            missing=not (item.entry.sha256 or item.entry.fault),
        )
        for item in rows
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
    found = clusters(rows, store.of_class().content.shares)
    vanished = store.vanished({item.entry.review_key for item in done})
    pages = sorted(file.name for file in (ledger.out / INSTRUCTOR_FOLDER).glob("*.html"))
    write_whole(overview, render_overview(rows, found, vanished, pages))
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
        graded = (one.entry.key for one in all_standing(ledger) if one.result is not None)
        found = tuple(sorted(map(ledger.folder, graded)))
        if not found:
            raise UsageError(f"{out}: nothing of this batch is graded yet")
        return found
    inside = sorted(file.parent.relative_to(out) for file in out.rglob(RESULT_FILE))
    found = tuple(out / path for path in inside if "/." not in f"/{path}")
    if not found:
        raise UsageError(f"{out}: there is no {RESULT_FILE} in it or in a folder below it")
    return found


def read_class(out: Path) -> list[ClassRow]:
    """The rows of the class at a path; of a folder of single reports, a row for each."""
    if (out / BATCH_FILE).is_file():
        ledger = Ledger(out)
        adjust = ClassAdjustments(ledger)
        return class_rows([adjust.row(row) for row in all_standing(ledger)], ledger)
    results = (for_class(read_result(folder / RESULT_FILE)) for folder in find_reports(out))
    return class_rows([Done(Entry(one.submission.id), one, fresh=False) for one in results])
