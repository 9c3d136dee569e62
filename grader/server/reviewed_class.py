"""A class as it is now: its results, with all that is written down about it."""

from __future__ import annotations

import threading
from collections.abc import Iterable
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
from grader.report.model.result_model import AdjustmentPart, AttemptPart
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
        return next((part.sha256 for part in self._tried if part.counts), self.attempt)

    @property
    def written(self) -> AttemptReview:
        """What is written about what is shown."""
        return self.saved.content.of(self.attempt)

    @property
    def earlier(self) -> list[AttemptReview]:
        """What is written about the attempts before it."""
        return self.saved.content.others_than(self.written, [part.sha256 for part in self._tried])

    @property
    def _tried(self) -> tuple[AttemptPart, ...]:
        """All attempts, as the result has them."""
        return self.row.result.attempts if self.row.result is not None else ()

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
        written = self.ledger.read()
        course = file_version(self.out / written.course) if written.course else None
        forgiven = self.store.of_class().content.forgiven
        of_class = (file_version(self.out / BATCH_FILE), course, forgiven)
        # Made once, where a row is read again.
        adjust: ClassAdjustments | None = None
        read: dict[str, _Read] = {}
        for entry in written.entries:
            files = (self.ledger.folder(entry.key) / RESULT_FILE, self.store.file(entry.review_key))
            version = (*map(file_version, files), of_class)
            if entry.key not in self._known or self._known[entry.key][0] != version:
                adjust = adjust or ClassAdjustments(self.ledger)
                self._known[entry.key] = version, self._read(entry, adjust)
            read[entry.key] = self._known[entry.key][1]
        attempts = _attempts(written.entries)
        rows = []
        every = [done for done, _, _ in read.values()]
        for row in class_rows(every, self.ledger, attempts=True):
            done, saved, problem = read[row.id]
            of_student = attempts[_student(done.entry)]
            rows.append(ReviewedRow(row, done.entry, saved, problem, of_student))
        return rows

    def find(self, name: str) -> tuple[ReviewedRow, list[ReviewedRow]]:
        """A row by the name in its address, and all rows without earlier attempts."""
        rows = self._all()
        for row in rows:
            if row.name == name:
                return row, [other for other in rows if not other.entry.attempt_of]
        raise UsageError(f"{name}: is no submission of this class any more")

    def counted(self, row: ReviewedRow) -> ReviewedRow:
        """The row of the attempt that counts for the student whose row it is."""
        of_student = (other for other in (row, *self._all()) if other.row.id in row.attempts)
        return next((other for other in of_student if other.attempt == row.counts), row)

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
            saved = Saved(StudentReview(key=entry.review_key), "")
            return replace(done, entry=entry.with_problem(why), result=result), saved, why


def _attempts(entries: Iterable[Entry]) -> dict[str, tuple[str, ...]]:
    """Key of a student -> keys of all rows of the student, first to last."""
    attempts: dict[str, tuple[str, ...]] = {}
    for entry in sorted(entries, key=lambda entry: not entry.attempt_of):
        student = _student(entry)
        attempts[student] = (*attempts.get(student, ()), entry.key)
    return attempts


def _student(entry: Entry) -> str:
    return entry.attempt_of or entry.key
