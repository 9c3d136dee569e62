"""What a late hand-in costs, and that nothing costs anything without a rule and a sure time."""

from __future__ import annotations

import math
from datetime import datetime, timedelta, timezone
from zoneinfo import ZoneInfo

from hypothesis import given
from hypothesis import strategies as st

from grader.course.attempts import HandInTime, Lateness, lateness
from grader.course.load import Rules
from grader.course.model import Late

BERLIN = ZoneInfo("Europe/Berlin")
DUE = datetime(2026, 3, 3, 0, 0, tzinfo=BERLIN)
TEN_PERCENT = Late(per="day", deduct="10 %", grace="15 min")
MINUTE, HOUR, DAY = timedelta(minutes=1), timedelta(hours=1), timedelta(days=1)

policies = st.builds(
    Late,
    per=st.sampled_from(["day", "hour"]),
    deduct=st.sampled_from(["10 %", "0 %", "33.3 %", 0.5, 3.0]),
    grace=st.sampled_from([0, "15 min", "120 min"]),
    at_most=st.sampled_from([None, "50 %", 4.0]),
)
zones = st.sampled_from([BERLIN, ZoneInfo("America/New_York"), timezone.utc])
dues = st.datetimes(datetime(2026, 1, 1), datetime(2026, 12, 31)).map(
    lambda one: one.replace(second=0, microsecond=0)
)
delays = st.timedeltas(timedelta(0), timedelta(days=9))


def rules_of(
    due: datetime = DUE, late: Late | None = TEN_PERCENT, closes: datetime | None = None
) -> Rules:
    """Rules without an extension."""
    return Rules(due, due, closes, late, None)


def cost(by: timedelta, rules: Rules, score: float = 8.0, **about: bool) -> Lateness:
    """What a delay costs, of 10 points."""
    moment = rules.due.astimezone(timezone.utc) + by
    handed = HandInTime(moment.isoformat(), "Gradescope's metadata", **about)
    return lateness(handed, score, rules, 10.0)


def test_a_deduction_says_rule_times_and_source() -> None:
    found = cost(20 * MINUTE, rules_of())
    assert found.line is not None
    assert (found.line.kind, found.line.title, found.line.points) == ("late", "Late by 20 min", -1)
    assert found.line.reason == (
        "handed in 2026-03-03 00:20 Europe/Berlin by Gradescope's metadata, 20 min after the due "
        "time 2026-03-03 00:00 Europe/Berlin; 1 day × 10 % of 10 points"
    )


def test_the_minute_of_the_due_time_belongs_to_it() -> None:
    strict = rules_of(late=Late(per="hour", deduct=1.0))
    assert cost(timedelta(seconds=59.9), strict).line is None
    assert cost(MINUTE, strict).points == 1


@given(dues, zones, policies, delays, st.floats(0, 10))
def test_nothing_is_deducted_in_time_or_in_the_grace_and_never_more_than_there_is(
    due: datetime, zone: ZoneInfo, late: Late, by: timedelta, score: float
) -> None:
    rules = rules_of(due.replace(tzinfo=zone), late)
    assert cost(-by, rules, score).line is None
    points = cost(by, rules, score).points
    assert 0 <= points <= score
    if by.total_seconds() <= late.grace:
        assert points == 0


@given(dues, zones, policies, delays, delays)
def test_later_never_costs_less(
    due: datetime, zone: ZoneInfo, late: Late, by: timedelta, more: timedelta
) -> None:
    rules = rules_of(due.replace(tzinfo=zone), late)
    assert cost(by, rules).points <= cost(by + more, rules).points


@given(delays)
def test_without_a_policy_nothing_is_deducted(by: timedelta) -> None:
    assert cost(by, rules_of(late=None)).line is None


@given(st.integers(0, 200))
def test_hours_that_have_begun_are_counted(hours: int) -> None:
    late = Late(per="hour", deduct=0.01)
    found = cost(hours * HOUR + MINUTE, rules_of(late=late))
    assert math.isclose(found.points, 0.01 * (hours + 1))


def test_a_day_ends_at_the_hour_of_the_due_time_also_when_the_clocks_are_changed() -> None:
    due = datetime(2026, 10, 24, 12, 0, tzinfo=BERLIN)
    late = Late(per="day", deduct=1.0)
    # This day has 25 hours.
    assert cost(25 * HOUR, rules_of(due, late)).points == 1
    assert cost(25 * HOUR + MINUTE, rules_of(due, late)).points == 2


def test_a_limit_of_the_deduction_is_kept_and_said() -> None:
    late = Late(per="day", deduct="10 %", at_most="25 %")
    found = cost(5 * DAY, rules_of(late=late))
    assert found.points == 2.5
    assert found.line is not None
    assert found.line.reason.endswith("5 days × 10 % of 10 points, at most 25 %")


def test_after_the_end_nothing_counts() -> None:
    found = cost(3 * DAY, rules_of(closes=DUE + DAY))
    assert (found.points, found.closed) == (8, True)
    assert cost(DAY, rules_of(closes=DUE + DAY)).points == 1


def test_nothing_is_deducted_on_a_time_that_is_not_known_for_sure() -> None:
    rules = rules_of()
    for handed, note in (
        (HandInTime(), ""),
        (HandInTime(marked_late=True), "marked late, but not by how much, so nothing is deducted"),
        (
            HandInTime("2026-03-04T12:00:00", "the name of the file"),
            "handed in 2026-03-04 12:00 without a zone by the name of the file, so nothing is",
        ),
        (
            HandInTime("2027-03-04T12:00:00Z", "git", graded="2026-03-05T08:00:00+01:00"),
            "but graded before that: a clock is wrong, so nothing is deducted",
        ),
        (
            HandInTime("2026-03-01T12:00:00Z", "the roster", marked_late=True),
            "marked late by the platform, but handed in 2026-03-01 13:00 Europe/Berlin by the",
        ),
    ):
        found = lateness(handed, 8.0, rules, 10.0)
        assert (found.points, found.line) == (0, None)
        assert note in found.note if note else found.note == ""


def test_with_an_extension_a_platform_may_call_it_late() -> None:
    rules = Rules(DUE + 2 * DAY, DUE, None, TEN_PERCENT, None)
    found = cost(-DAY, rules, marked_late=True)
    assert (found.points, found.note) == (0, "")
