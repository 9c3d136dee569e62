"""A class as it is now: its results, with what is written in the review files."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Level
from grader.batch.class_files import class_rows, standing
from grader.batch.edited_assignment import load_used
from grader.batch.ledger import Entry, Ledger
from grader.errors import RosgradeError, UsageError
from grader.report.files import folder_name
from grader.report.model.class_row import ClassRow
from grader.report.model.result_model import AdjustmentPart, Result
from grader.review.adjust import adjusted
from grader.review.model import ClassReview, StudentReview
from grader.review.store import ReviewStore, Saved
from grader.submission.kept_source import SOURCE_FOLDER, KeptSource, read_source

BY_RULE = ("late", "attempts")


class CachedLedger(Ledger):
    """The folder of a batch, whose results are read again only when they change."""

    def __init__(self, out: Path) -> None:
        """Name the folder."""
        super().__init__(out)
        self._known: dict[str, tuple[object, Result | None]] = {}

    def result(self, key: str) -> Result | None:
        """A row's result, or None where there is none."""
        version = _version(self.folder(key) / "result.json")
        if key not in self._known or self._known[key][0] != version:
            self._known[key] = (version, super().result(key))
        return self._known[key][1]


@dataclass(frozen=True)
class ReviewedRow:
    """A row with its review; ``problem`` says why that cannot be read."""

    row: ClassRow
    key: str
    """Of the review: a team has one."""
    saved: Saved[StudentReview]
    problem: str = ""

    @property
    def name(self) -> str:
        """In the addresses of its pages."""
        return folder_name(self.row.id)


@dataclass
class ReviewedClass:
    """The class in a folder; ``by`` are the initials of who reviews."""

    out: Path
    by: str
    store: ReviewStore = field(init=False)
    ledger: Ledger = field(init=False)
    _reviews: dict[str, tuple[object, Saved[StudentReview]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Open the folder."""
        self.ledger, self.store = CachedLedger(self.out), ReviewStore(self.out)
        self.ledger.read()

    @cached_property
    def loaded(self) -> LoadedAssignment:
        """The assignment that the class was graded with; deleted from here when it changes."""
        return load_used(self.ledger)

    def levels(self) -> dict[str, tuple[Level, ...]]:
        """The levels of each manual item; none where the assignment cannot be read any more."""
        try:
            return {one.id: one.levels for one in self.loaded.assignment.manual}
        except RosgradeError:
            return {}

    def of_class(self) -> ClassReview:
        """What is written about the whole class."""
        return self.store.of_class().content

    def rows(self) -> list[ReviewedRow]:
        """All rows, sorted by key."""
        entries = {entry.key: entry for entry in self.ledger.read().entries}
        done = [standing(self.ledger, entry) for entry in entries.values()]
        of_class = self.of_class()
        return [
            self._reviewed(row, entries[row.id], of_class) for row in class_rows(done, self.ledger)
        ]

    def find(self, name: str) -> tuple[ReviewedRow, list[ReviewedRow]]:
        """A row by the name in its address, and all rows."""
        rows = self.rows()
        for row in rows:
            if row.name == name:
                return row, rows
        raise UsageError(f"{name}: is no submission of this class any more")

    def source(self, row: ReviewedRow) -> KeptSource:
        """What was handed in, as far as it is text and was kept."""
        return read_source(self.ledger.folder(row.row.id) / SOURCE_FOLDER)

    def _reviewed(self, row: ClassRow, entry: Entry, of_class: ClassReview) -> ReviewedRow:
        key = entry.review_key
        saved, problem = Saved(StudentReview(key=key), ""), ""
        try:
            saved = self._review(key)
            if row.result is not None:
                by_rule = [one for one in row.result.adjustments if one.kind in BY_RULE]
                result = adjusted(row.result, saved.content, of_class, by_rule)
                row = replace(row, result=result)
        except RosgradeError as error:
            problem = str(error)
            note = "; ".join(filter(None, (problem.partition("\n")[0], row.note)))
            row = replace(row, note=note, result=_waiting(row.result))
        return ReviewedRow(row, key, saved, problem)

    def _review(self, key: str) -> Saved[StudentReview]:
        version = _version(self.store.file(key))
        if key not in self._reviews or self._reviews[key][0] != version:
            self._reviews[key] = (version, self.store.student(key))
        return self._reviews[key][1]


def _waiting(result: Result | None) -> Result | None:
    """A result whose review cannot be read has no points yet."""
    if result is None:
        return None
    unread = AdjustmentPart(kind="manual", title="The review cannot be read", points=None)
    return result.model_copy(update={"adjustments": (unread,)})


def _version(file: Path) -> object:
    """What is another one for each version of a file; None where there is none."""
    try:
        known = file.stat()
    except OSError:
        return None
    return known.st_ino, known.st_size, known.st_mtime_ns
