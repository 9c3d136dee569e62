"""The results of a class with what persons and the rules of the course add to them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path

from grader.batch.batch import Done
from grader.batch.ledger import Entry, Ledger
from grader.course.attempts import HandInTime, Ruled, ruled
from grader.course.load import Course, load_course
from grader.errors import UsageError
from grader.grading.attempts import attempts_of
from grader.report.audience import VISIBLE_ONLY
from grader.report.model.result_model import AttemptPart, Result
from grader.review.adjust import adjusted
from grader.review.model import ClassReview
from grader.review.store import ReviewStore


class ClassAdjustments:
    """What is written down about a class now; a call gives a result with it.

    It replaces what the result has of it, so doing it twice is the same as once. Without rules of
    a course the last attempt counts.
    """

    def __init__(self, ledger: Ledger, now: datetime | None = None) -> None:
        """Read the rows, and the rules where the batch has some.

        Args:
            now: For what students may see by now; by default the clock of this machine.
        """
        self._ledger, self._written = ledger, ledger.read()
        self._entries = {entry.key: entry for entry in self._written.entries}
        self._earlier: dict[str, list[Entry]] = defaultdict(list)
        for entry in self._written.entries:
            self._earlier[entry.attempt_of].append(entry)
        self._store = ReviewStore(ledger.out)
        self._now = now or datetime.now(timezone.utc)
        self._course = _remembered(self._written.course, ledger.out, self._written.assignment)

    def __call__(self, result: Result) -> Result:
        """A result of the class with all that is added to it."""
        return self._with_notes(result)[0]

    def row(self, row: Done) -> Done:
        """A row of the class with all that is added to its result, and to its problem."""
        if row.result is None:
            return row
        result, notes = self._with_notes(row.result)
        return replace(row, entry=row.entry.with_problem(*notes), result=result)

    @property
    def visible(self) -> frozenset[str]:
        """Which checks the students may see now, by their visibility."""
        if self._course is None:
            return VISIBLE_ONLY
        return self._course.visible(self._written.assignment, self._now)

    def vanished(self) -> tuple[str, ...]:
        """Students with a review that no row of the class uses; every review is read for it.

        Raises:
            RosgradeError: One that a person wrote cannot be read.
        """
        _ = self._of_class
        keys = {entry.review_key for entry in self._entries.values()}
        for key in keys:
            self._store.student(key)
        return self._store.vanished(keys)

    def _with_notes(self, result: Result) -> tuple[Result, tuple[str, ...]]:
        """A result with all that is added, and notes for the instructor."""
        entry = self._entries.get(result.submission.id)
        if entry is None:
            return self._reviewed(result, result.submission.id), ()
        attempts = [*self._graded_before(entry), (entry, result)]
        hashes = [attempt.sha256 for attempt, _ in attempts]
        results = [
            self._reviewed(of_attempt, entry.review_key, hashes[:index])
            for index, (_, of_attempt) in enumerate(attempts)
        ]
        times = [
            HandInTime(attempt.handed_in, attempt.handed_in_from, attempt.late, of_attempt.started)
            for attempt, of_attempt in attempts
        ]
        by_rules = Ruled(counts=len(attempts) - 1)
        if self._course is not None and not entry.attempt_of:
            rules = self._course.rules(self._written.assignment, entry.key)
            by_rules = ruled(results, times, rules)
        parts: tuple[AttemptPart, ...] = ()
        if len(attempts) > 1:
            parts = attempts_of(results, [time.at for time in times], by_rules.counts)
        last, counted = results[-1], results[by_rules.counts]
        adjustments = [
            *(one for one in counted.adjustments if one.is_of_counted),
            *(one for one in last.adjustments if not one.is_of_counted),
            *by_rules.lines,
        ]
        update = {"attempts": parts, "adjustments": tuple(adjustments)}
        return last.model_copy(update=update), by_rules.notes

    def _graded_before(self, entry: Entry) -> Iterator[tuple[Entry, Result]]:
        """The earlier attempts of a row that are graded, first to last."""
        for attempt in self._earlier.get(entry.key, ()):
            result = self._ledger.result(attempt.key)
            if result is not None and result.submission.sha256 == attempt.sha256:
                yield attempt, result

    def _reviewed(self, result: Result, key: str, before: Sequence[str] = ()) -> Result:
        return adjusted(result, self._store.student(key).content, self._of_class, before)

    @cached_property
    def _of_class(self) -> ClassReview:
        return self._store.of_class().content


def course_of(out: Path, named: Path | None, assignment: str) -> Course | None:
    """The rules for a batch: those that are named, else those that it was graded with before."""
    if named is not None:
        return _load(named, assignment)
    try:
        place = Ledger(out).read().course
    except UsageError:
        # There is no batch yet, or its file is damaged and is written again from the class.
        return None
    return _remembered(place, out, assignment)


def _remembered(place: str | None, out: Path, assignment: str) -> Course | None:
    """The rules that lie where a batch remembers, if it was graded with any."""
    if place is None:
        return None
    if not Path(place).is_file():
        raise UsageError(
            f"{place}: does not exist, and the rules of {out} lie there. Put it back, or name "
            "another place with `rosgrade batch ... --course FILE`"
        )
    return _load(Path(place), assignment)


def _load(file: Path, assignment: str) -> Course:
    course = load_course(file)
    # Refuse rules of other assignments at once.
    course.rules(assignment)
    return course
