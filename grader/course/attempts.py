"""Which attempt counts, and what it costs that it is late, as lines of the report.

Nothing is deducted without a rule, and never on a time that is not known for sure. Pure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from grader.course.instant import later, read_time, shown_length, shown_time, utc
from grader.course.load import Rules
from grader.course.model import Attempts, Late, points_of
from grader.grade.model import total
from grader.report.model.result_model import AdjustmentPart, Result

_NOTHING = "nothing is deducted"
_ADVICE = (
    f"{_NOTHING}: a column `handed_in` of the roster, with times such as 2026-10-12T23:59+02:00, "
    "says it"
)


@dataclass(frozen=True)
class HandInTime:
    """When something was handed in, as far as it is known.

    Attributes:
        at: ISO 8601, or empty; without an offset where the source has none.
        source: What tells it: ``Gradescope's metadata``.
        marked_late: Whether the platform says that it is late.
        graded: When grading began, ISO 8601; what was handed in later has a wrong clock.
    """

    at: str = ""
    source: str = ""
    marked_late: bool = False
    graded: str = ""

    def known(self, rules: Rules) -> tuple[datetime | None, str]:
        """When it was, to the minute; or None and why that is not known for sure."""
        if not self.at:
            note = f"marked late, but not by how much, so {_ADVICE}" if self.marked_late else ""
            return None, note
        moment = read_time(self.at)
        if moment.tzinfo is None:
            return None, f"handed in {shown_time(moment)} by {self.source}, so {_ADVICE}"
        # In the student's favour: a due time of 23:59 lasts until this minute ends.
        moment = moment.astimezone(rules.due.tzinfo).replace(second=0, microsecond=0)
        when = f"handed in {shown_time(moment)} by {self.source}"
        if self.graded and utc(moment) > utc(read_time(self.graded)):
            return None, f"{when}, but graded before that: a clock is wrong, so {_NOTHING}"
        if self.marked_late and utc(moment) <= utc(rules.due_of_all):
            text = f"marked late by the platform, but {when}, before the due time"
            return None, f"{text}: {_NOTHING}"
        return moment, ""

    def is_late(self, rules: Rules) -> bool:
        """Whether it is known to be later than the student's due time."""
        moment, _ = self.known(rules)
        return moment is not None and utc(moment) > utc(rules.due)


@dataclass(frozen=True)
class Lateness:
    """What the rules make of a hand-in.

    Attributes:
        points: Deducted, at least 0.
        line: Of the report, or None where there is nothing to say.
        note: For the instructor, where nothing is deducted because the time is in doubt.
        closed: Whether it came after the assignment closed.
    """

    points: float = 0.0
    line: AdjustmentPart | None = None
    note: str = ""
    closed: bool = False


def lateness(handed: HandInTime, score: float, rules: Rules, max_score: float) -> Lateness:
    """What lateness costs.

    Args:
        score: Points before; no more is deducted.
        max_score: All points of the assignment, of which a percentage is taken.
    """
    moment, note = handed.known(rules)
    if moment is None or utc(moment) <= utc(rules.due):
        return Lateness(note=note)
    late_by = utc(moment) - utc(rules.due)
    is_closed = rules.closes is not None and utc(moment) > utc(rules.closes)
    if is_closed:
        points, why = score, f"the assignment closed at {shown_time(rules.closes or moment)}"
    elif rules.late is None or late_by.total_seconds() <= rules.late.grace:
        return Lateness()
    else:
        units = _begun(rules.due, moment, rules.late.per)
        points, why = _deduction(rules.late, units, max_score)
        points = min(points, score)
    line = AdjustmentPart(
        kind="late",
        title="Handed in after the end" if is_closed else f"Late by {shown_length(late_by)}",
        points=0.0 - points,
        reason=f"handed in {shown_time(moment)} by {handed.source}, {shown_length(late_by)} after "
        f"the due time {shown_time(rules.due)}; {why}",
    )
    return Lateness(points, line, closed=is_closed)


def _deduction(late: Late, units: int, max_score: float) -> tuple[float, str]:
    """What so many days or hours of lateness cost, and how that is reckoned."""
    points = units * points_of(late.deduct, max_score)
    is_share = isinstance(late.deduct, str)
    each = f"{late.deduct} of {max_score:g}" if is_share else f"{late.deduct:g}"
    unit = late.per if units == 1 else f"{late.per}s"
    words = f"{units} {unit} × {each} points"
    if late.at_most is None:
        return min(points, max_score), words
    return min(points, points_of(late.at_most, max_score)), f"{words}, at most {late.at_most}"


def _begun(due: datetime, moment: datetime, per: str) -> int:
    """Days or hours that have begun between a due time and a later time."""
    unit = timedelta(days=1) if per == "day" else timedelta(hours=1)
    count = max(0, (utc(moment) - utc(due)) // unit - 1)
    while utc(later(due, count, per)) < utc(moment):
        count += 1
    return count


_NOT_COMPARED = "attempts without a grade, or of another version of the assignment, do not count"


@dataclass(frozen=True)
class Ruled:
    """What the rules of the course make of a student's attempts.

    Attributes:
        counts: Index of the attempt that counts.
        lines: Of the report, for the result of the last attempt.
        notes: For the instructor.
    """

    counts: int
    lines: tuple[AdjustmentPart, ...] = ()
    notes: tuple[str, ...] = ()


def ruled(results: Sequence[Result], times: Sequence[HandInTime], rules: Rules) -> Ruled:
    """Apply the rules to the attempts of a student, the last of which is the current one.

    Args:
        results: With what persons add to them.
        times: When each was handed in.
    """
    last, current = len(results) - 1, results[-1]
    if current.score is None:
        return Ruled(last)
    rule = rules.attempts or Attempts()
    # A deduction takes no more than is there by now.
    known_scores = [result.known_score or 0.0 for result in results]
    late = [
        lateness(time, score, rules, current.final_max_score)
        for time, score in zip(times, known_scores, strict=True)
    ]
    comparable = _comparable(results)
    allowed = [at for at in comparable if rule.at_most is None or at < rule.at_most] or [last]
    allowed = [at for at in allowed if not late[at].closed] or allowed
    counts = allowed[-1]
    if rule.counts == "best":
        # What a person may still give could make an attempt the best one.
        possible = [
            result.possible_score - one.points for result, one in zip(results, late, strict=True)
        ]
        counts = max(allowed, key=lambda at: (possible[at], known_scores[at], at))
    elif rule.counts == "last before the deadline":
        in_time = [at for at in allowed if not times[at].is_late(rules)]
        counts = (in_time or allowed)[-1]
    lines = [_line_of_attempt(results, counts, rule)] if counts != last else []
    lines += [line for line in [late[counts].line] if line is not None]
    notes = [late[counts].note] if late[counts].note else []
    if rules.attempts is not None and len(comparable) < len(results):
        notes.append(_NOT_COMPARED)
    return Ruled(counts, tuple(lines), tuple(notes))


def _comparable(results: Sequence[Result]) -> list[int]:
    """Indices of the attempts with a grade by the same version of the assignment as the last."""
    version = results[-1].assignment.sha256
    return [
        at
        for at, result in enumerate(results)
        if result.score is not None and result.assignment.sha256 == version
    ]


def _line_of_attempt(results: Sequence[Result], counts: int, rule: Attempts) -> AdjustmentPart:
    """The line of the last attempt's report that says which other one counts."""
    score, of_last = _judged_score(results[counts]), _judged_score(results[-1])
    return AdjustmentPart(
        kind="attempts",
        title=f"Attempt {counts + 1} of {len(results)} counts ({rule.words})",
        points=score - of_last,
        reason=f"it has {score:g} of {results[-1].max_score:g} points, the last attempt has "
        f"{of_last:g}",
    )


def _judged_score(result: Result) -> float:
    """The score with what persons added to it, but not what is of the attempt that counts."""
    added = [one.points for one in result.adjustments if not one.is_of_counted]
    return total(points for points in (result.score, *added) if points is not None)
