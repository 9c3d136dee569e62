"""Judging the recordings of a whole class again; nothing is run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.batch.batch import Done
from grader.batch.ledger import Entry, Ledger
from grader.errors import RosgradeError
from grader.grade.model import total
from grader.gradebook.adjusting import ClassAdjustments
from grader.gradebook.class_files import GRADES_FILE, NO_RESULT, all_standing, write_class
from grader.gradebook.rendering import bring_up_to_date
from grader.grading.files import RESULT_FILE, write_graded
from grader.grading.last_attempt import keep_earlier
from grader.grading.regrading import compare, find_recordings, refuse_other, regrade
from grader.report.model.facts import Clock, RunFacts
from grader.report.model.result import make_result
from grader.report.model.result_model import Result


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
        before, after = (
            one.score if one is not None else None for one in (self.before, self.done.result)
        )
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
    refuse_other(ledger.out, written.assignment, loaded)
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
        found = find_recordings(folder)
    except RosgradeError as error:
        why = str(error).partition("\n")[0]
        noted = entry.with_problem(f"not judged again: {why}")
        return Regraded(Done(noted, before, fresh=False), before, problem=why)
    graded = regrade(loaded, found)
    changes = tuple(compare(before, graded.grade))
    if not write:
        facts = RunFacts(before.started, before.duration_s)
        after = make_result(graded.grade, graded.recordings, facts)
        return Regraded(Done(entry, after, fresh=True), before, changes)
    version = (before.assignment.sha256, before.assignment.location)
    if changes or version != (loaded.sha256, loaded.location):
        keep_earlier(folder / RESULT_FILE)
        write_graded(graded, folder, Clock(), amended=adjust)
    return Regraded(Done(entry, ledger.result(entry.key), fresh=True), before, changes)
