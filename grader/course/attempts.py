"""Which attempt counts, and what it costs that it is late. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from grader.course.late import HandInTime, Lateness, known_time, lateness
from grader.course.load import Rules, utc
from grader.course.model import Attempts
from grader.report.model.result_model import AdjustmentPart, Result


@dataclass(frozen=True)
class Attempt:
    """One of the times that a student handed in; its result is with what persons add to it."""

    result: Result
    time: HandInTime


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
    tokens: int = 0


def ruled(
    attempts: Sequence[Attempt],
    rules: Rules,
    tokens_left: int = 0,
) -> Ruled:
    """Apply the rules to the attempts of a student, the last of which is the current one."""
    last, current = len(attempts) - 1, attempts[-1].result
    if current.score is None:
        return Ruled(last)
    scores = [each.result.known_score or 0.0 for each in attempts]
    late = [
        lateness(each.time, rules, current.final_max_score, score, tokens_left)
        for each, score in zip(attempts, scores, strict=True)
    ]
    same = [
        at
        for at, each in enumerate(attempts)
        if each.result.score is not None
        and each.result.assignment.sha256 == current.assignment.sha256
    ]
    rule = rules.attempts or Attempts()
    counts = _counted(rule, attempts, rules, late, scores, same)
    lines, notes = [], [late[counts].note]
    if counts != last:
        lines.append(
            AdjustmentPart(
                kind="attempts",
                title=f"Attempt {counts + 1} of {len(attempts)} counts ({rule.words})",
                points=scores[counts] - scores[last],
                reason=f"it has {scores[counts]:g} of {current.known_max_score:g} points, the last "
                f"attempt has {scores[last]:g}",
            )
        )
    line = late[counts].line
    if rules.attempts and len(same) < len(attempts):
        notes.append(
            "an attempt that is not graded, or graded with another version of the assignment, "
            "does not count"
        )
    return Ruled(
        counts,
        (*lines, line) if line else tuple(lines),
        tuple(filter(None, notes)),
        late[counts].tokens,
    )


def _counted(
    rule: Attempts,
    attempts: Sequence[Attempt],
    rules: Rules,
    late: Sequence[Lateness],
    scores: Sequence[float],
    same: Sequence[int],
) -> int:
    allowed = [at for at in same if rule.at_most is None or at < rule.at_most] or same[-1:]
    allowed = [at for at in allowed if not late[at].closed] or allowed
    if rule.counts == "best":
        return max(allowed, key=lambda at: (scores[at] - late[at].points, at))
    if rule.counts == "last before the deadline":
        times = {at: known_time(attempts[at].time, rules)[0] for at in allowed}
        in_time = [at for at, time in times.items() if not time or utc(time) <= utc(rules.due)]
        allowed = in_time or allowed
    return allowed[-1]
