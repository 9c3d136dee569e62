"""The statistics behind timing.period."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.measure.period import MOST_INTERVALS, PeriodLimits, forgiven, intervals, judge
from tests.checks.builder import after, every, message, messages, recording, taken

LIMITS = PeriodLimits(period_s=0.3, median_s=0.015, spread_s=0.03, outliers=0.1)


def stream(times):
    return messages(times)["/cmd_vel"]


def test_intervals_are_differences_of_source_timestamps():
    found = [item.seconds for item in intervals(stream([1.0, 1.3, 1.7, 1.9]))]
    assert found == pytest.approx([0.3, 0.4, 0.2])


def test_no_interval_from_one_message_or_none():
    assert intervals(()) == ()
    assert intervals(stream([1.0])) == ()


def test_a_gap_in_the_writers_numbers_is_no_interval():
    found = intervals(
        [message(1.0, sequence=1), message(1.6, sequence=3), message(1.9, sequence=4)]
    )
    assert [item.seconds for item in found] == pytest.approx([0.3])


@pytest.mark.parametrize("numbers", [(1, 1, 2, 2), (0, 0, 0, 0)])
def test_numbers_of_several_writers_or_none_hide_nothing(numbers):
    times = [1.0, 1.1, 1.3, 1.4]
    found = intervals([message(t, sequence=n) for t, n in zip(times, numbers, strict=True)])
    assert len(found) == 3


def test_a_flood_is_judged_by_its_beginning():
    assert len(intervals(stream(every(0.0005, 3 * MOST_INTERVALS)))) == MOST_INTERVALS


@pytest.mark.parametrize(
    ("seconds", "irregular"),
    [
        ([0.3] * 5, ()),
        # One message 60 ms late: too long, then as much too short.
        ([0.3, 0.36, 0.24, 0.3, 0.3], (1,)),
        # Late and never made up for, as when a loop sleeps.
        ([0.3, 0.36, 0.3, 0.3, 0.3], (1,)),
        # Two long ones are two.
        ([0.3, 0.36, 0.36, 0.3, 0.3], (1, 2)),
        # Too short first is no late message.
        ([0.3, 0.24, 0.36, 0.3, 0.3, 0.3, 0.3], (1, 2)),
        # Not as much too short.
        ([0.3, 0.5, 0.24, 0.3, 0.3, 0.3, 0.3], (1, 2)),
        ([0.3, 0.3, 0.3, 0.36], (3,)),
    ],
)
def test_irregular_intervals_have_no_period(seconds, irregular):
    assert judge(seconds, LIMITS).irregular == irregular


@pytest.mark.parametrize(
    ("outliers", "intervals_", "allowed"),
    [(0.1, 5, 1), (0.1, 11, 1), (0.1, 20, 2), (0.1, 29, 2), (0.0, 100, 0), (0.25, 8, 2)],
)
def test_how_many_may_be_irregular(outliers, intervals_, allowed):
    assert PeriodLimits(0.3, 0.015, 0.03, outliers).allowed(intervals_) == allowed


@given(st.lists(st.floats(0.01, 1.0), min_size=1, max_size=30))
def test_reversing_time_keeps_the_median(seconds):
    assert judge(seconds, LIMITS).median_s == judge(seconds[::-1], LIMITS).median_s


def test_what_the_host_took_is_given_back_but_never_more_than_the_deviation():
    times = after([0.3, 0.5, 0.1, 0.3])
    run = recording(messages=messages(times), disturbance=taken(1.05, 1.5, waited_s=0.15))
    found = forgiven(run, intervals(run.on("/cmd_vel")), LIMITS)
    assert found == pytest.approx((0.3, 0.35, 0.25, 0.3))
    more = recording(messages=messages(times), disturbance=taken(1.05, 1.5, waited_s=5.0))
    assert forgiven(more, intervals(more.on("/cmd_vel")), LIMITS) == pytest.approx((0.3,) * 4)


@given(st.lists(st.floats(0.01, 1.0), min_size=2, max_size=20))
def test_nothing_is_given_back_where_nothing_was_taken(seconds):
    run = recording(messages=messages(after(seconds)))
    measured = intervals(run.on("/cmd_vel"))
    assert forgiven(run, measured, LIMITS) == tuple(item.seconds for item in measured)
    assert all(a.end_ns == b.begin_ns for a, b in pairwise(measured))
