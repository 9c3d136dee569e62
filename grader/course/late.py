"""What a late hand-in costs. Pure: from times and rules to lines of the report.

Nothing is deducted without a rule, and never on a time that is not known for sure.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from grader.course.instant import later, read_time, shown_length, shown_time
from grader.course.load import Rules, utc
from grader.course.model import points_of
from grader.report.model.result_model import AdjustmentPart

_ADVICE = "a column `handed_in` of the roster, with times such as 2026-10-12T23:59+02:00, says it"


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
    tokens: int = 0
    line: AdjustmentPart | None = None
    note: str = ""
    closed: bool = False


def known_time(handed: HandInTime, rules: Rules) -> tuple[datetime | None, str]:
    """When it was handed in, to the minute; or None and why that is not known for sure."""
    if not handed.at:
        text = "marked late, but not by how much, so nothing is deducted"
        return None, f"{text}: {_ADVICE}" if handed.marked_late else ""
    moment = read_time(handed.at)
    if moment.tzinfo is None:
        text = f"handed in {shown_time(moment)} by {handed.source}: nothing is deducted"
        return None, f"{text}: {_ADVICE}"
    # The student's favour: a due time of 23:59 lasts until this minute ends.
    moment = moment.replace(second=0, microsecond=0).astimezone(rules.due.tzinfo)
    said = f"handed in {shown_time(moment)} by {handed.source}"
    if handed.graded and utc(moment) > utc(read_time(handed.graded)):
        return None, f"{said}, but graded before that: a clock is wrong, so nothing is deducted"
    return moment, ""


def lateness(
    handed: HandInTime, rules: Rules, max_score: float, score: float, tokens_left: int = 0
) -> Lateness:
    """What lateness costs.

    Args:
        max_score: All points of the assignment, of which a percentage is taken.
        score: Points before; no more is deducted.
        tokens_left: Late tokens that the student still has.
    """
    moment, note = known_time(handed, rules)
    if moment is None:
        return Lateness(note=note)
    if utc(moment) <= utc(rules.due):
        if handed.marked_late and utc(moment) <= utc(rules.due_of_all):
            text = f"marked late by the platform, but handed in {shown_time(moment)} by "
            note = f"{text}{handed.source}, before the due time: nothing is deducted"
        return Lateness(note=note)
    by = utc(moment) - utc(rules.due)
    reason = (
        f"handed in {shown_time(moment)} by {handed.source}, {shown_length(by)} after the due "
        f"time {shown_time(rules.due)}"
    )
    if rules.closes and utc(moment) > utc(rules.closes):
        text = f"{reason}; the assignment closed at {shown_time(rules.closes)}"
        line = AdjustmentPart(
            kind="late", title="Handed in after the end", points=-score, reason=text
        )
        return Lateness(score, line=line, closed=True)
    late = rules.late
    if late is None or by <= timedelta(seconds=late.grace):
        return Lateness()
    due, used = rules.due, 0
    if rules.tokens is not None:
        worth = rules.tokens.worth
        used = min(_begun(due, moment, worth), tokens_left)
        due = later(due, used, worth)
    grace = timedelta(seconds=late.grace)
    count = _begun(due, moment, late.per) if utc(moment) - utc(due) > grace else 0
    costs = count * points_of(late.deduct, max_score)
    most = min(score, max_score if late.at_most is None else points_of(late.at_most, max_score))
    points = max(0.0, min(costs, most))
    if not (used or costs):
        return Lateness()
    units = f"{count} {late.per if count == 1 else f'{late.per}s'}"
    share = f"{late.deduct} of {max_score:g} points"
    if not isinstance(late.deduct, str):
        share = f"{late.deduct:g} points"
    limit = f", at most {late.at_most}" if late.at_most is not None else ""
    rule = f"{units} × {share}{limit}"
    spent = f"{used} late {'token' if used == 1 else 'tokens'} used" if used else ""
    parts = [reason, spent, rule if count else ""]
    line = AdjustmentPart(
        kind="late",
        title=f"Late by {shown_length(by)}",
        points=-points,
        reason="; ".join(part for part in parts if part),
    )
    return Lateness(points, used, line)


def _begun(due: datetime, moment: datetime, per: str) -> int:
    """Days or hours that have begun between a due time and a later time; 0 if it is not later."""
    if utc(moment) <= utc(due):
        return 0
    unit = timedelta(days=1) if per == "day" else timedelta(hours=1)
    count = max(0, (utc(moment) - utc(due)) // unit - 1)
    while utc(later(due, count, per)) < utc(moment):
        count += 1
    return count
