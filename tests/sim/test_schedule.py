"""Rates on a grid of steps."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.schedule import Schedule

STEP_NS = 10_000_000


def times_ms(schedule: Schedule, seconds: float) -> list[int]:
    steps = range(1, round(seconds * 100) + 1)
    return [10 * k for k in steps if schedule.is_due(k * STEP_NS)]


def test_thirty_hertz_is_three_hundred_times_in_ten_seconds() -> None:
    schedule = Schedule(30.0)
    assert len(times_ms(schedule, 10.0)) == 300


def test_thirty_hertz_comes_at_the_first_step_that_is_not_early() -> None:
    assert times_ms(Schedule(30.0), 0.2) == [40, 70, 100, 140, 170, 200]


@given(st.integers(1, 100), st.integers(1, 30))
def test_no_rate_drifts(rate: int, seconds: int) -> None:
    assert len(times_ms(Schedule(float(rate)), seconds)) == rate * seconds


@given(st.floats(0.1, 100.0))
def test_each_time_is_the_first_step_at_or_after_a_multiple_of_the_period(rate: float) -> None:
    period = 1000 / Fraction(rate).limit_denominator(1_000_000)
    for count, time in enumerate(times_ms(Schedule(rate), 1.0), start=1):
        assert time - 10 < count * period <= time


def test_it_tells_when_it_will_be_due_next() -> None:
    schedule = Schedule(30.0)
    for step in range(1, 301):
        expected = schedule.next_ns(STEP_NS)
        assert schedule.is_due(step * STEP_NS) is (step * STEP_NS == expected)


def test_it_is_silent_outside_its_window() -> None:
    window = Schedule(10.0, starts_ns=300_000_000, stops_ns=600_000_000)
    assert times_ms(window, 2.0) == [300, 400, 500]


@pytest.mark.parametrize("rate", [30.0, 29.97])
def test_it_is_exact_after_a_day(rate: float) -> None:
    day_ns = 86_400 * 1_000_000_000
    schedule = Schedule(rate)
    assert schedule.is_due(day_ns)
    due = [k for k in range(1, 1001) if schedule.is_due(day_ns + k * STEP_NS)]
    assert len(due) in (int(rate * 10), int(rate * 10) + 1)
