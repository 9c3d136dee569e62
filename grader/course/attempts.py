"""Which attempt counts, and what it costs that it is late. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from grader.course.late import HandInTime, lateness
from grader.course.load import Rules
from grader.course.model import Attempts
from grader.grade.model import total
from grader.report.model.result_model import AdjustmentPart, Result

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
