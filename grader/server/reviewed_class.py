"""A class as it is now: its results, with all that is written down about it."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.batch.batch import Done
from grader.batch.ledger import BATCH_FILE, Entry, Ledger
from grader.batch.used_assignment import load_used
from grader.errors import RosgradeError, UsageError
from grader.gradebook.adjusting import ClassAdjustments
from grader.gradebook.class_files import class_rows, standing
from grader.grading.files import RESULT_FILE
from grader.report.files import file_version, folder_name
from grader.report.model.class_row import ClassRow
from grader.report.model.cluster import Cluster, clusters
from grader.report.model.result_model import AdjustmentPart
from grader.review.model import AttemptReview, StudentReview
from grader.review.store import ReviewStore, Saved
from grader.submission.kept_source import SOURCE_FOLDER, KeptSource, read_kept_source

_Read = tuple[Done, Saved[StudentReview], str]
"""A row, its review, and why that cannot be read."""


@dataclass(frozen=True)
class ReviewedRow:
    """A row with its review; ``problem`` says why that cannot be read.

    ``attempts`` are the keys of all rows of the student, first to last.
    """

    row: ClassRow
    entry: Entry
    saved: Saved[StudentReview]
    problem: str
    attempts: tuple[str, ...]

    @property
    def attempt(self) -> str:
        """The hash of what is shown."""
        return self.entry.sha256 or "nothing"

    @property
    def counts(self) -> str:
        """The hash of the attempt that counts, which is the one that a person gives points to."""
        tried = self.row.result.attempts if self.row.result is not None else ()
        return next((one.sha256 for one in tried if one.counts), self.attempt)

    @property
    def written(self) -> AttemptReview:
        """What is written about what is shown."""
        return self.saved.content.of(self.attempt)

    @property
    def earlier(self) -> list[AttemptReview]:
        """What is written about the attempts before it."""
        tried = self.row.result.attempts if self.row.result is not None else ()
        return self.saved.content.others_than(self.written, [one.sha256 for one in tried])

    @property
    def name(self) -> str:
        """In the addresses of its pages."""
        return folder_name(self.row.id)


class ReviewedClass:
    """The class in a folder; each file is read again only when it changes."""

    def __init__(self, out: Path, by: str) -> None:
        """Open the folder; ``by`` are the initials of who reviews."""
        self.out, self.by = out, by
        self.ledger, self.store = Ledger(out), ReviewStore(out)
        self._reading = threading.Lock()
        self._known: dict[str, tuple[object, _Read]] = {}
        self._loaded: tuple[object, LoadedAssignment] | None = None
        self.ledger.read()

    @property
    def loaded(self) -> LoadedAssignment:
        """The assignment that the class is graded with."""
        version = file_version(self.out / BATCH_FILE)
        if self._loaded is None or self._loaded[0] != version:
            self._loaded = version, load_used(self.ledger)
        return self._loaded[1]

    def rows(self) -> list[ReviewedRow]:
        """All rows without earlier attempts, sorted by key."""
        return [row for row in self._all() if not row.entry.attempt_of]

    def _all(self) -> list[ReviewedRow]:
        # Else who asks while the class is read would read all of it once more.
        with self._reading:
            return self._rows()

    def _rows(self) -> list[ReviewedRow]:
        written, adjust = self.ledger.read(), None
        course = file_version(self.out / written.course) if written.course else None
        forgiven = self.store.of_class().content.forgiven
        shared = (file_version(self.out / BATCH_FILE), course, forgiven)
        found = {}
        for entry in written.entries:
            files = (self.ledger.folder(entry.key) / RESULT_FILE, self.store.file(entry.review_key))
            version = (*map(file_version, files), shared)
            known, read = self._known.get(entry.key, (None, None))
            if read is None or known != version:
                adjust = adjust or ClassAdjustments(self.ledger)
                read = self._read(entry, adjust)
                self._known[entry.key] = version, read
            found[entry.key] = read
        attempts: dict[str, tuple[str, ...]] = {}
        for entry in sorted(written.entries, key=lambda one: not one.attempt_of):
            student = entry.attempt_of or entry.key
            attempts[student] = (*attempts.get(student, ()), entry.key)
        rows = []
        for row in class_rows([one[0] for one in found.values()], self.ledger, attempts=True):
            done, saved, problem = found[row.id]
            of_student = attempts[done.entry.attempt_of or row.id]
            rows.append(ReviewedRow(row, done.entry, saved, problem, of_student))
        return rows

    def find(self, name: str) -> tuple[ReviewedRow, list[ReviewedRow]]:
        """A row by the name in its address, and all rows without earlier attempts."""
        rows = self._all()
        for row in rows:
            if row.name == name:
                return row, [one for one in rows if not one.entry.attempt_of]
        raise UsageError(f"{name}: is no submission of this class any more")

    def counted(self, row: ReviewedRow) -> ReviewedRow:
        """The row of the attempt that counts for the student whose row it is."""
        tried = (one for one in (row, *self._all()) if one.row.id in row.attempts)
        return next((one for one in tried if one.attempt == row.counts), row)

    def clusters(self) -> tuple[Cluster, ...]:
        """Failures with the same cause."""
        return clusters([row.row for row in self.rows()], self.store.of_class().content.shares)

    def source(self, row: ReviewedRow) -> KeptSource:
        """What was handed in, as far as it is text and was kept."""
        return read_kept_source(self.ledger.folder(row.row.id) / SOURCE_FOLDER)

    def _read(self, entry: Entry, adjust: ClassAdjustments) -> _Read:
        done = standing(self.ledger, entry)
        try:
            saved = self.store.student(entry.review_key)
            return adjust.row(done), saved, ""
        except RosgradeError as error:
            # No points until it can be read: what a person gave must not seem to be taken away.
            why = str(error)
            unread = AdjustmentPart(kind="manual", title="a review that can be read", points=None)
            result = done.result and done.result.model_copy(update={"adjustments": (unread,)})
            entry = replace(entry, problem="; ".join(filter(None, (entry.problem, why))))
            saved = Saved(StudentReview(key=entry.review_key), "")
            return replace(done, entry=entry, result=result), saved, why
