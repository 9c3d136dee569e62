"""Rendering a report again, as it was graded; nothing is run and no grade changes."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from grader.assignment.load import load_assignment
from grader.assignment.selection import select, visible_part
from grader.batch.batch import Done
from grader.batch.class_files import class_rows, standing
from grader.batch.files import RESULT_FILE, write_report
from grader.batch.ledger import BATCH_FILE, Entry, Ledger
from grader.batch.regrading import find, regrade, regrade_command, stored_assignment
from grader.errors import UsageError
from grader.grade import Grade
from grader.report.model.class_row import ClassRow
from grader.report.model.result import read_result
from grader.report.model.result_model import Result

_load = cache(load_assignment)


def find_reports(out: Path) -> tuple[Path, ...]:
    """The report folders at a path: itself, or those of a class in it, sorted.

    Hidden folders are left out: a batch that still runs writes in them. So is what a batch has
    left in its folder of rows that it does not have any more, or of what was handed in before.
    """
    if not out.exists():
        raise UsageError(f"{out}: does not exist")
    if (out / RESULT_FILE).is_file():
        return (out,)
    if (out / BATCH_FILE).is_file():
        return _of_batch(Ledger(out))
    inside = sorted(file.parent.relative_to(out) for file in out.rglob(RESULT_FILE))
    hidden = [path for path in inside if any(part.startswith(".") for part in path.parts)]
    found = tuple(out / path for path in inside if path not in hidden)
    if not found:
        raise UsageError(f"{out}: there is no {RESULT_FILE} in it, nor in a folder below it")
    return found


def _of_batch(ledger: Ledger) -> tuple[Path, ...]:
    found = []
    for entry in ledger.read().entries:
        if entry.fault:
            continue
        result = ledger.result(entry.key)
        damaged = result is None and (ledger.folder(entry.key) / RESULT_FILE).is_file()
        if damaged or (result is not None and result.submission.sha256 == entry.sha256):
            found.append(ledger.folder(entry.key))
    if not found:
        raise UsageError(f"{ledger.out}: nothing of this batch is graded yet")
    return tuple(sorted(found))


def read_class(out: Path) -> list[ClassRow]:
    """The rows of the class at a path; of a folder of single reports, a row for each."""
    results = [read_result(folder / RESULT_FILE) for folder in find_reports(out)]
    if (out / BATCH_FILE).is_file():
        ledger = Ledger(out)
        return class_rows([standing(ledger, entry) for entry in ledger.read().entries], ledger)
    return class_rows([Done(Entry(one.submission.id), one, fresh=False) for one in results])


def render_again(folder: Path, assignment: str | None = None) -> Result:
    """Render the report of one submission again from its result and its recordings."""
    found = find(folder)
    result = found.result or read_result(folder / RESULT_FILE)
    loaded = _load(assignment or _stored(folder, result))
    if loaded.sha256 != result.assignment.sha256:
        raise UsageError(
            f"{folder}: the assignment has changed since this was graded: "
            f"{regrade_command(folder, loaded)} judges again with it as it is now"
        )
    shown = visible_part(loaded) if result.withheld.checks else loaded
    graded = regrade(select(shown, tuple(check.id for check in result.checks)), found)
    changed = _changed(result, graded.grade)
    if changed:
        raise UsageError(
            f"{folder}: judged again it is not what the result says ({', '.join(changed)}): "
            f"{regrade_command(folder, loaded)} writes both anew"
        )
    write_report(graded, folder, result)
    return result


def _stored(folder: Path, result: Result) -> str:
    assignment = result.assignment
    return stored_assignment(folder, assignment.id, assignment.location, "report", str(folder))


def _changed(result: Result, grade: Grade) -> list[str]:
    before = {check.id: check.status for check in result.checks}
    return [one.id for one in grade.results if before.get(one.id) is not one.status]
