"""The rules of a course, applied to the results of a class."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from functools import cached_property
from pathlib import Path

from grader.batch.attempts import attempts_of
from grader.batch.ledger import BATCH_FILE, Entry, Ledger
from grader.course.attempts import Attempt, Ruled, ruled
from grader.course.late import HandInTime
from grader.course.load import Course, load_course
from grader.errors import UsageError
from grader.report.model.result_model import AttemptPart, Result
from grader.report.model.student import VISIBLE_ONLY


class ClassRules:
    """What the rules of a course make of the rows of a batch; without rules the last counts."""

    def __init__(self, ledger: Ledger) -> None:
        """Read the rows, and the rules where the batch has some."""
        self._ledger, self._written = ledger, ledger.read()
        written = self._written
        place = Path(written.course) if written.course is not None else None
        self.course = _load(place, ledger.out, written.assignment) if place else None
        self._spent: dict[str, int] = {}

    def visible(self, now: datetime) -> frozenset[str]:
        """Which checks the students may see at a time, by their visibility."""
        if self.course is None:
            return VISIBLE_ONLY
        return self.course.visible(self._written.assignment, now)

    def applied(
        self, entry: Entry, result: Result, reviewed: Callable[[Result], Result]
    ) -> tuple[Result, tuple[str, ...]]:
        """A result with its attempts and the lines of the rules; and notes for the instructor.

        They replace those that it has, so doing it twice is the same as once.

        Args:
            reviewed: Gives the result of an attempt with what persons add to it.
        """
        attempts = [
            replace(each, result=reviewed(each.result)) for each in self._attempts(entry, result)
        ]
        found = self._ruled(entry, attempts)
        parts: tuple[AttemptPart, ...] = ()
        if len(attempts) > 1:
            times = [each.time.at for each in attempts]
            parts = attempts_of([each.result for each in attempts], times, found.counts)
        whole = attempts[-1].result
        update = {"attempts": parts, "adjustments": (*whole.adjustments, *found.lines)}
        return whole.model_copy(update=update), found.notes

    def _ruled(self, entry: Entry, attempts: list[Attempt]) -> Ruled:
        if self.course is None or entry.attempt_of:
            return Ruled(len(attempts) - 1)
        rules = self.course.rules(self._written.assignment, entry.key)
        tokens = 0
        if rules.tokens and any(each.time.is_late(rules) for each in attempts):
            spent = sum(one.spent(entry.key) for one in self._before)
            tokens = max(0, rules.tokens.each - spent)
        return ruled(attempts, rules, tokens)

    def spent(self, key: str) -> int:
        """Late tokens that a student used in this class."""
        if key not in self._spent:
            entry, result = self.entries.get(key), self._ledger.result(key)
            self._spent[key] = 0
            if entry is not None and result is not None:
                self._spent[key] = self._ruled(entry, self._attempts(entry, result)).tokens
        return self._spent[key]

    @cached_property
    def entries(self) -> dict[str, Entry]:
        """The rows by their keys."""
        return {entry.key: entry for entry in self._written.entries}

    @cached_property
    def _earlier(self) -> dict[str, list[Entry]]:
        """The earlier attempts of each row, first to last: 10 comes after 9."""
        found: dict[str, list[Entry]] = {}
        for entry in sorted(self._written.entries, key=lambda one: (len(one.key), one.key)):
            if entry.attempt_of:
                found.setdefault(entry.attempt_of, []).append(entry)
        return found

    @cached_property
    def _before(self) -> list[ClassRules]:
        """The classes of assignments that were due before this one, as far as they are known."""
        found: list[ClassRules] = []
        for folder in self.course.results_before(self._written.assignment) if self.course else ():
            if (folder / BATCH_FILE).is_file():
                one = ClassRules(Ledger(folder))
                one._before = list(found)
                found.append(one)
        return found

    def _attempts(self, entry: Entry, result: Result) -> list[Attempt]:
        """All attempts that are graded, the current one last."""
        graded = ((one, self._ledger.result(one.key)) for one in self._earlier.get(entry.key, ()))
        same = [
            (one, other) for one, other in graded if other and other.submission.sha256 == one.sha256
        ]
        return [
            Attempt(
                found,
                HandInTime(one.handed_in, one.handed_in_from, one.late, found.started),
            )
            for one, found in (*same, (entry, result))
        ]


def course_of(out: Path, named: Path | None, assignment: str) -> Course | None:
    """The rules for a batch: those that are named, else those that it was graded with before."""
    try:
        place = named or Ledger(out).read().course
    except UsageError:
        # There is no batch yet, or its file is damaged and is written again from the class.
        return None
    return _load(Path(place), out, assignment) if place is not None else None


def _load(file: Path, out: Path, assignment: str) -> Course:
    if not file.is_file():
        raise UsageError(
            f"{file}: does not exist, and the rules of {out} lie there. Put it back, or name "
            "another place with `rosgrade batch ... --course FILE`"
        )
    found = load_course(file)
    # Refuse rules of other assignments at once.
    found.rules(assignment)
    return found
