"""Judging the recordings of a whole class again; nothing is run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.batch.adjusting import ClassAdjustments
from grader.batch.batch import Done
from grader.batch.class_files import NO_RESULT, standing
from grader.batch.files import RESULT_FILE, write_graded
from grader.batch.ledger import Entry, Ledger, keep_earlier
from grader.batch.regrading import compare, find, refuse_other, regrade
from grader.errors import RosgradeError
from grader.grade.model import total
from grader.report.model.facts import Clock
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
        """Points gained, negative if lost; 0 unless both have all their points."""
        before, after = (
            one.final_score if one is not None else None for one in (self.before, self.done.result)
        )
        return total((after, -before)) if before is not None and after is not None else 0.0

    @property
    def in_doubt(self) -> bool:
        """Whether there was a grade before, but not any more."""
        after = self.done.result
        graded = self.before is not None and self.before.graded
        return graded and (after is None or not after.graded)


def regrade_class(
    loaded: LoadedAssignment, ledger: Ledger, only: Path | None = None
) -> Iterator[Regraded]:
    """Judge the rows of a batch with the assignment as it is now.

    A result that changes is kept beside the new one, in ``earlier/``. With the folder of a row's
    report, only that row is judged, and those with the same submission.
    """
    written = ledger.read()
    entries = written.entries
    adjust = ClassAdjustments(ledger)
    refuse_other(ledger.out, written.assignment, loaded)
    chosen = {
        entry.same_as or entry.key
        for entry in entries
        if only is None or ledger.folder(entry.key).name == only.resolve().name
    }
    for entry in entries:
        before = ledger.result(entry.key)
        if entry.fault:
            yield Regraded(Done(entry, None, fresh=False), None, problem=entry.fault)
        elif (entry.same_as or entry.key) not in chosen:
            yield Regraded(standing(ledger, entry), before)
        elif before is not None and entry.sha256 in ("", before.submission.sha256):
            yield _regrade(loaded, ledger, entry, before, adjust)
        elif entry.sha256:
            yield _not_judged(entry, None, NO_RESULT)
        else:
            yield Regraded(Done(entry, None, fresh=False), None)
    if only is None:
        version = (loaded.assignment.id, loaded.sha256, loaded.location)
        ledger.write(entries, *version, written.course)


def _regrade(
    loaded: LoadedAssignment,
    ledger: Ledger,
    entry: Entry,
    before: Result,
    adjust: ClassAdjustments,
) -> Regraded:
    folder = ledger.folder(entry.key)
    try:
        found = find(folder)
    except RosgradeError as error:
        return _not_judged(entry, before, str(error).partition("\n")[0])
    graded = regrade(loaded, found)
    changes = tuple(compare(before, graded.grade))
    version = (before.assignment.sha256, before.assignment.location)
    if changes or version != (loaded.sha256, loaded.location):
        keep_earlier(folder / RESULT_FILE)
        write_graded(graded, folder, Clock(), amended=adjust)
    return Regraded(Done(entry, ledger.result(entry.key), fresh=True), before, changes)


def _not_judged(entry: Entry, before: Result | None, why: str) -> Regraded:
    problem = "; ".join(part for part in (entry.problem, f"not judged again: {why}") if part)
    return Regraded(Done(replace(entry, problem=problem), before, fresh=False), before, problem=why)
