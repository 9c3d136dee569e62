"""How a grade is put into words, the same in every report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from grader.assignment.model import Visibility, Withheld
from grader.checks.finding import Finding, Status
from grader.checks.wording import counted
from grader.grade.model import CheckResult, Grade
from grader.grade.points import total
from grader.recording.event import Breach
from grader.report.model.result_model import CheckPart, PlacePart
from grader.submission.record import SourceError


@dataclass(frozen=True)
class StatusWords:
    """A status for people; the symbol tells it without colour, and in ASCII too."""

    word: str
    symbol: str
    ascii: str


STATUS = {
    Status.PASSED: StatusWords("passed", "✓", "+"),
    Status.FAILED: StatusWords("failed", "✗", "x"),
    Status.SKIPPED: StatusWords("skipped", "–", "-"),
    Status.ERROR: StatusWords("error", "!", "!"),
}

HIDDEN_UNTIL = {
    Visibility.VISIBLE: "",
    Visibility.AFTER_DUE_DATE: "for students after the due date",
    Visibility.AFTER_PUBLISHED: "for students after grades are published",
    Visibility.HIDDEN: "never shown to students",
}

ENVIRONMENT = {
    "ros_distro": "ROS distribution",
    "ros_source": "ROS from",
    "rmw": "RMW",
    "python": "Python",
    "sandbox": "Sandbox",
    "domain_id": "ROS domain",
    "cpus": "CPUs",
}


LIMITS_REACHED = "Limits of the sandbox that were reached"
WORTH_KNOWING = "Worth knowing"
ADVICE = ("try next", "also")
"""What stands before the first piece of advice, and before every other."""


def number(value: float) -> str:
    """Points without needless digits: ``3``, ``2.5``."""
    return f"{value:.10g}"


def tally(grade: Grade, status: Status) -> str:
    """``9 passed``, ``1 error``; nothing where there are none."""
    count = len(grade.of(status))
    if not count:
        return ""
    return counted(count, "error") if status is Status.ERROR else f"{count} {STATUS[status].word}"


def headline(grade: Grade) -> str:
    """One sentence on the whole, and one on what is judged only at grading."""
    statuses = [result.status for result in grade.results]
    full_points = grade.full_points and grade.max_score > 0
    return summary(statuses, grade.withheld, graded=grade.graded, full_points=full_points)


def summary(
    statuses: Sequence[Status], withheld: Withheld, *, graded: bool, full_points: bool
) -> str:
    """:func:`headline` of checks that ended so; ``full_points`` of those that there are."""
    every, passed = len(statuses), statuses.count(Status.PASSED)
    failed, skipped = statuses.count(Status.FAILED), statuses.count(Status.SKIPPED)
    if not graded:
        text = "Something of the grader or of the machine failed; no point is lost by it"
    elif full_points or passed == every:
        text = f"{passed} of {every} visible checks passed" if withheld.checks else "Full points"
        if failed:
            text += f"; {counted(failed, 'check')} without points failed"
    else:
        text = f"{counted(failed, 'check')} failed"
        if skipped:
            verb = "waits" if skipped == 1 else "wait"
            text += f", {counted(skipped, 'other')} {verb} for {'it' if failed == 1 else 'them'}"
    if graded and Status.ERROR in statuses:
        errors = counted(statuses.count(Status.ERROR), "check")
        text += f"; {errors} without points could not be judged"
    return f"{text}{announcement(withheld)}."


def announcement(withheld: Withheld) -> str:
    """What to say of checks that are left out, to follow a sentence; nothing where none are."""
    if not withheld.checks:
        return ""
    verb = "runs" if withheld.checks == 1 else "run"
    return (
        f"; {counted(withheld.checks, 'hidden check')}, "
        f"{counted_points(withheld.points)}, {verb} at grading"
    )


def counted_points(points: float) -> str:
    """``1 point``, ``2.5 points``."""
    return f"{number(points)} point{'' if points == 1 else 's'}"


def first_place(first: CheckResult | CheckPart) -> str:
    """Where in the student's code it is to be mended, as ``file.py:8``; or nothing."""
    places: Sequence[SourceError | PlacePart] = (
        first.decisive.finding.evidence.places
        if isinstance(first, CheckResult)
        else first.evidence.places
    )
    return "".join(place.file + (f":{place.line}" if place.line else "") for place in places[:1])


def points_waiting(check: str, checks: Iterable[CheckResult | CheckPart]) -> str:
    """``4.25 points wait for this``: what is skipped because a check failed; or nothing."""
    points = total(one.max_points for one in checks if check in one.waits_for)
    if not points:
        return ""
    return f"{counted_points(points)} {'waits' if points == 1 else 'wait'} for this"


def waiting(grade: Grade, result: CheckResult) -> str:
    """How many checks depend on a failed one, or nothing."""
    same = grade.same_reason(result.id)
    if same:
        failed = {result.id, *(other.id for other in same)}
        count = len(same) + sum(not failed.isdisjoint(one.waits_for) for one in grade.results)
        return f"{counted(count, 'other check')} did not pass for the same reason."
    count = len(grade.waiting_for(result.id))
    if not count:
        return ""
    verb = "waits" if count == 1 else "wait"
    return f"{counted(count, 'other check')} {verb} for it."


def limit_reached(breach: Breach) -> str:
    """What reached which limit of the sandbox, and what came of it."""
    then = "they were ended for it" if breach.ended else "anything more is refused"
    return f"the processes of the submission {breach.violation}; {then}"


def advice(result: CheckResult, finding: Finding) -> tuple[str, ...]:
    """What to try next: the check's hint, then the author's own where a check failed."""
    own = result.hint if finding.status is Status.FAILED else ""
    return tuple(dict.fromkeys(text for text in (finding.hint, own) if text))
