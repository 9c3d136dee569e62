"""Which of the attempts of a student counts."""

from __future__ import annotations

from datetime import datetime, timezone

import pytest

from grader.course.attempts import HandInTime, Ruled, ruled
from grader.course.load import Rules
from grader.course.model import Attempts, Late
from grader.report.model.result_model import Result
from tests.grade.sample import Told
from tests.report.sample import judged

DUE = datetime(2026, 3, 10, 12, 0, tzinfo=timezone.utc)
ANY = judged([Told("node")]).result
LATE = Late(per="day", deduct=1.0)


def attempt(score: float | None, day: int | None, version: str = "a") -> tuple[Result, HandInTime]:
    """An attempt with some points of 10, handed in at noon of a day of March."""
    result = ANY
    assignment = result.assignment.model_copy(update={"sha256": version})
    changes = {"score": score, "max_score": 10.0, "assignment": assignment}
    time = HandInTime(f"2026-03-{day:02}T12:00:00+00:00" if day else "", "the roster")
    return result.model_copy(update=changes), time


def rule(
    attempts: Attempts | None,
    *tried: tuple[Result, HandInTime],
    late: Late | None = LATE,
    closes: int | None = None,
) -> Ruled:
    """Which counts."""
    end = DUE.replace(day=closes) if closes else None
    results, times = zip(*tried, strict=True)
    return ruled(results, times, Rules(DUE, DUE, end, late, attempts))


BEST, LAST = Attempts(counts="best"), Attempts(counts="last")
IN_TIME = Attempts(counts="last before the deadline")


@pytest.mark.parametrize(
    ("attempts", "tried", "counts"),
    [
        (None, [(8, 1), (6, 2)], 1),
        (LAST, [(8, 1), (6, 2)], 1),
        (BEST, [(8, 1), (6, 2)], 0),
        # What is late has lost a point before it is compared.
        (BEST, [(8, 1), (8.5, 11)], 0),
        (BEST, [(8, 1), (9.5, 11)], 1),
        (BEST, [(8, 1), (8, 2)], 1),
        (IN_TIME, [(5, 1), (4, 9), (8, 11)], 1),
        (IN_TIME, [(5, 11), (6, 12)], 1),
        # A time that is not known is not held against the student.
        (IN_TIME, [(5, 1), (8, None)], 1),
        (Attempts(counts="best", at_most=2), [(5, 1), (6, 2), (9, 3)], 1),
        (Attempts(at_most=2), [(5, 1), (6, 2), (9, 3)], 1),
    ],
)
def test_the_rule_says_which_attempt_counts(
    attempts: Attempts | None, tried: list[tuple[float, int | None]], counts: int
) -> None:
    assert rule(attempts, *(attempt(*each) for each in tried)).counts == counts


def test_the_final_score_is_that_of_the_attempt_that_counts() -> None:
    found = rule(BEST, attempt(9, 11), attempt(7.5, 12))
    (line, late) = found.lines
    assert (line.kind, line.title, line.points) == ("attempts", "Attempt 1 of 2 counts (best)", 1.5)
    assert line.reason == "it has 9 of 10 points, the last attempt has 7.5"
    assert (late.kind, late.points) == ("late", -1)


def test_what_came_after_the_end_counts_only_where_nothing_else_does() -> None:
    assert rule(LAST, attempt(5, 9), attempt(9, 14), closes=12).counts == 0
    alone = rule(LAST, attempt(9, 14), closes=12)
    assert [line.points for line in alone.lines] == [-9]


def test_a_grade_of_another_version_is_not_compared() -> None:
    found = rule(BEST, attempt(9, 1, version="old"), attempt(5, 2), attempt(None, 3), attempt(4, 4))
    assert found.counts == 1
    assert found.notes == (
        "attempts without a grade, or of another version of the assignment, do not count",
    )


def test_nothing_is_said_of_what_is_not_graded() -> None:
    assert rule(BEST, attempt(9, 1), attempt(None, 12)) == Ruled(1)
