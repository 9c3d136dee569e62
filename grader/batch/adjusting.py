"""The results of a class with what persons and the rules of the course add to them."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timezone
from functools import partial

from grader.batch.batch import Done
from grader.batch.course_rules import ClassRules
from grader.batch.ledger import Ledger
from grader.report.model.result_model import Result
from grader.review.adjust import adjusted
from grader.review.store import ReviewStore


class ClassAdjustments:
    """What is written down about a class now; a call gives a result with it."""

    def __init__(self, ledger: Ledger, now: datetime | None = None) -> None:
        """Read what is about the whole class.

        Args:
            now: For what students may see by now; by default the clock of this machine.

        Raises:
            RosgradeError: A file that a person wrote cannot be read.
        """
        self._store = ReviewStore(ledger.out)
        self._now = now or datetime.now(timezone.utc)
        self._of_class = self._store.of_class().content
        self._rules = ClassRules(ledger)
        self._entries = self._rules.entries

    def __call__(self, result: Result) -> Result:
        """A result of the class with all that is added to it."""
        return self._with_notes(result)[0]

    def row(self, row: Done) -> Done:
        """A row of the class with all that is added to its result, and to its problem."""
        if row.result is None:
            return row
        result, notes = self._with_notes(row.result)
        return replace(row, entry=row.entry.with_problem(*notes), result=result)

    def _with_notes(self, result: Result) -> tuple[Result, tuple[str, ...]]:
        key = result.submission.id
        entry = self._entries.get(key)
        review = self._store.student(entry.review_key if entry is not None else key).content
        reviewed = partial(adjusted, review=review, of_class=self._of_class)
        return self._rules.applied(entry, result, reviewed) if entry else (reviewed(result), ())

    @property
    def visible(self) -> frozenset[str]:
        """Which checks the students may see now, by their visibility."""
        return self._rules.visible(self._now)

    def vanished(self) -> tuple[str, ...]:
        """Students with a review that no row of the class uses; every review is read for it."""
        keys = {entry.review_key for entry in self._entries.values()}
        for key in keys:
            self._store.student(key)
        return self._store.vanished(keys)
