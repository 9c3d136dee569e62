"""A class made again from what is stored, its reports or also its grades; nothing is run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cache
from pathlib import Path

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.assignment.selection import select, visible_part
from grader.batch.batch import Done
from grader.batch.ledger import Entry, Ledger
from grader.batch.used_assignment import refuse_changed, regrade_command
from grader.errors import RosgradeError, UsageError
from grader.grade.model import total
from grader.gradebook.adjusting import ClassAdjustments
from grader.gradebook.class_files import GRADES_FILE, NO_RESULT, all_standing, write_class
from grader.grading import regrading
from grader.grading.files import RESULT_FILE, write_graded, write_report
from grader.grading.last_attempt import keep_earlier
from grader.report.audience import VISIBLE_ONLY
from grader.report.files import write_whole
from grader.report.model.facts import Clock, RunFacts
from grader.report.model.result import make_result, read_result, result_json
from grader.report.model.result_model import Result

NOT_UP_TO_DATE = "its report is not up to date"
_load = cache(load_assignment)


def bring_up_to_date(
    done: Iterable[Done], ledger: Ledger, now: datetime | None = None
) -> list[Done]:
    """Write every report of a class that differs from what is written down about it now.

    That is what a person or a rule of the course adds. A report that cannot be rendered is left as
    it is, and its row says why; the points of the row count all the same.

    Returns:
        The rows with the results as they are now.
    """
    adjust = ClassAdjustments(ledger, now)
    released = adjust.visible - VISIBLE_ONLY
    rows = []
    for before in done:
        row = adjust.row(before)
        entry, result = row.entry, row.result
        checks = result.checks if result is not None else ()
        shows_more = row.fresh and any(check.visibility in released for check in checks)
        if result != before.result or shows_more:
            try:
                render_again(ledger.folder(entry.key), amended=adjust)
            except RosgradeError as error:
                entry = entry.with_problem(f"{NOT_UP_TO_DATE}: {error}")
        rows.append(replace(row, entry=entry))
    return rows


def render_again(
    folder: Path,
    assignment: str | None = None,
    amended: ClassAdjustments | None = None,
) -> Result:
    """Render the report of one submission again from its result and its recordings.

    Args:
        amended: What is added to the results of its class now.
    """
    found = regrading.find_recordings(folder)
    result = found.result or read_result(folder / RESULT_FILE)
    loaded = _load(assignment or found.assignment_folder("report", str(folder)))
    refuse_changed(folder, result.assignment.sha256, loaded)
    if result.withheld.checks:
        loaded = visible_part(loaded)
    judged = select(loaded, tuple(check.id for check in result.checks))
    graded = regrading.regrade(judged, found)
    stored = {check.id: check.status for check in result.checks}
    changed = [check.id for check in graded.grade.results if stored.get(check.id) != check.status]
    if changed:
        raise UsageError(
            f"{folder}: judging again does not give the stored result ({', '.join(changed)}). "
            f"{regrade_command(folder, loaded)} writes the new result and report"
        )
    now = amended(result) if amended is not None else result
    write_report(graded, folder, now, amended.visible if amended is not None else VISIBLE_ONLY)
    if now != result:
        write_whole(folder / RESULT_FILE, result_json(now))
    return now


@dataclass(frozen=True)
class Regraded:
    """A row that was judged again."""

    done: Done
    before: Result | None
    changes: tuple[str, ...] = ()
    problem: str = ""

    @property
    def gained(self) -> float:
        """Points of the checks gained, negative if lost; 0 unless both are graded."""
        before = self.before.score if self.before is not None else None
        after = self.done.result.score if self.done.result is not None else None
        return total((after, -before)) if before is not None and after is not None else 0.0


def regrade_class(
    loaded: LoadedAssignment, ledger: Ledger, *, write: bool = True
) -> Iterator[Regraded]:
    """Judge the rows of a batch with the assignment as it is now.

    A result that changes is kept beside the new one, in ``earlier/``. With ``write=False`` nothing
    is written: a preview of who gains and who loses.
    """
    written = ledger.read()
    adjust = ClassAdjustments(ledger)
    # What people wrote must be readable before anything is written.
    adjust.vanished()
    regrading.refuse_other(ledger.out, written.assignment, loaded)
    for row in all_standing(ledger):
        if row.result is not None:
            yield _regrade(loaded, ledger, row.entry, row.result, adjust, write=write)
        else:
            why = row.entry.fault or (NO_RESULT if row.entry.sha256 else "")
            yield Regraded(row, None, problem=why)
    if write:
        version = (loaded.assignment.id, loaded.sha256, loaded.location)
        ledger.write(written.entries, *version, written.course)


def write_regraded(rows: Sequence[Regraded], ledger: Ledger) -> Path:
    """Write gradebook and overview after a regrade; a gradebook that changes is kept as earlier."""
    if any(row.changes for row in rows):
        keep_earlier(ledger.out / GRADES_FILE)
    return write_class(bring_up_to_date((row.done for row in rows), ledger), ledger)


def _regrade(
    loaded: LoadedAssignment,
    ledger: Ledger,
    entry: Entry,
    before: Result,
    adjust: ClassAdjustments,
    *,
    write: bool,
) -> Regraded:
    folder = ledger.folder(entry.key)
    try:
        found = regrading.find_recordings(folder)
    except RosgradeError as error:
        why = str(error).partition("\n")[0]
        noted = entry.with_problem(f"not judged again: {why}")
        return Regraded(Done(noted, before, fresh=False), before, problem=why)
    graded = regrading.regrade(loaded, found)
    changes = tuple(regrading.compare(before, graded.grade))
    if not write:
        facts = RunFacts(before.started, before.duration_s)
        after = make_result(graded.grade, graded.recordings, facts)
        return Regraded(Done(entry, after, fresh=True), before, changes)
    version = (before.assignment.sha256, before.assignment.location)
    if changes or version != (loaded.sha256, loaded.location):
        keep_earlier(folder / RESULT_FILE)
        write_graded(graded, folder, Clock(), amended=adjust)
    return Regraded(Done(entry, ledger.result(entry.key), fresh=True), before, changes)
