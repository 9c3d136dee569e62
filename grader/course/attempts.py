"""Which attempt counts, and what it costs that it is late, as lines of the report.

Nothing is deducted without a rule, and never on a time that is not known for sure. Pure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from grader.course.instant import later, read_time, shown_length, shown_time, utc
from grader.course.load import Rules
from grader.course.model import Attempts, points_of
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
        said = f"handed in {shown_time(moment)} by {self.source}"
        if self.graded and utc(moment) > utc(read_time(self.graded)):
            return None, f"{said}, but graded before that: a clock is wrong, so {_NOTHING}"
        if self.marked_late and utc(moment) <= utc(rules.due_of_all):
            text = f"marked late by the platform, but {said}, before the due time"
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
    by, late = utc(moment) - utc(rules.due), rules.late
    closed = rules.closes is not None and utc(moment) > utc(rules.closes)
    points, words = score, f"the assignment closed at {shown_time(rules.closes or moment)}"
    if not closed:
        if late is None or by.total_seconds() <= late.grace:
            return Lateness()
        count = _begun(rules.due, moment, late.per)
        most = max_score if late.at_most is None else points_of(late.at_most, max_score)
        points = min(count * points_of(late.deduct, max_score), most, score)
        is_share = isinstance(late.deduct, str)
        each = f"{late.deduct} of {max_score:g}" if is_share else f"{late.deduct:g}"
        limit = f", at most {late.at_most}" if late.at_most is not None else ""
        words = f"{count} {late.per}{'s' * (count != 1)} × {each} points{limit}"
    line = AdjustmentPart(
        kind="late",
        title="Handed in after the end" if closed else f"Late by {shown_length(by)}",
        points=0.0 - points,
        reason=f"handed in {shown_time(moment)} by {handed.source}, {shown_length(by)} after the "
        f"due time {shown_time(rules.due)}; {words}",
    )
    return Lateness(points, line, closed=closed)


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
    rule, most = rules.attempts or Attempts(), current.final_max_score
    # What a person may still give could make an attempt the best one.
    scores = [each.possible_score for each in results]
    known = [each.known_score or 0.0 for each in results]
    late = [lateness(*each, rules, most) for each in zip(times, known, strict=True)]
    version = current.assignment.sha256
    same = [
        at
        for at, each in enumerate(results)
        if each.score is not None and each.assignment.sha256 == version
    ]
    allowed = [at for at in same if rule.at_most is None or at < rule.at_most] or [last]
    allowed = [at for at in allowed if not late[at].closed] or allowed
    counts = allowed[-1]
    if rule.counts == "best":
        counts = max(allowed, key=lambda at: (scores[at] - late[at].points, known[at], at))
    elif rule.counts == "last before the deadline":
        in_time = [at for at in allowed if not times[at].is_late(rules)]
        counts = (in_time or allowed)[-1]
    lines = [late[counts].line]
    if counts != last:
        judged, of_last = (_judged(results[at]) for at in (counts, last))
        line = AdjustmentPart(
            kind="attempts",
            title=f"Attempt {counts + 1} of {len(results)} counts ({rule.words})",
            points=judged - of_last,
            reason=f"it has {judged:g} of {current.max_score:g} points, the last attempt has "
            f"{of_last:g}",
        )
        lines.insert(0, line)
    notes = (late[counts].note, _NOT_COMPARED if rules.attempts and len(same) <= last else "")
    return Ruled(
        counts, tuple(line for line in lines if line is not None), tuple(filter(None, notes))
    )


def _judged(result: Result) -> float:
    added = (one.points for one in result.adjustments if not one.is_of_counted)
    return total(points for points in (result.score, *added) if points is not None)
