"""The results of a class with what persons and the rules of the course add to them."""

from __future__ import annotations

from grader.batch.ledger import Ledger
from grader.report.model.result_model import Result
from grader.review.adjust import adjusted
from grader.review.store import ReviewStore


class ClassAdjustments:
    """What is written down about a class now; a call gives a result with it."""

    def __init__(self, ledger: Ledger) -> None:
        """Read what is about the whole class.

        Raises:
            RosgradeError: A file that a person wrote cannot be read.
        """
        self._store = ReviewStore(ledger.out)
        self._of_class = self._store.of_class().content
        self._entries = {entry.key: entry for entry in ledger.read().entries}

    def __call__(self, result: Result) -> Result:
        """A result of the class with all that is added to it."""
        key = result.submission.id
        entry = self._entries.get(key)
        review = self._store.student(entry.review_key if entry is not None else key).content
        return adjusted(result, review, self._of_class)

    def vanished(self) -> tuple[str, ...]:
        """Students with a review that no row of the class uses; every review is read for it."""
        return self._store.vanished({entry.review_key for entry in self._entries.values()})
