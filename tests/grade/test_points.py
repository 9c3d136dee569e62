"""Points: exact where a check passed, rounded once where it gave partial credit."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.grade.model import points_for, total


@pytest.mark.parametrize(
    ("max_points", "credit", "points"),
    [
        (3.0, 1.0, 3.0),
        (0.125, 1.0, 0.125),
        (3.0, 0.0, 0.0),
        (3.0, 0.34, 1.02),
        (1.0, 0.125, 0.13),
        (3.0, 2 / 3, 2.0),
        (4.0, 0.9999, 3.99),
        (0.0, 0.5, 0.0),
        (0.005, 0.5, 0.0),
    ],
)
def test_points_of_a_check(max_points, credit, points):
    assert points_for(max_points, credit) == points


def test_sums_have_no_binary_noise():
    assert total([0.1, 0.2]) == 0.3
    assert total([0.1] * 10) == 1.0


@given(st.decimals(0, 100, places=2), st.floats(0.0, 1.0))
def test_only_full_credit_has_full_points(max_points, credit):
    full = float(max_points)
    points = points_for(full, credit)
    assert 0.0 <= points <= full
    assert credit == 1.0 or points < full or full == 0.0


@given(st.decimals(0, 100, places=2), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_more_credit_is_never_worth_less(max_points, one, other):
    low, high = sorted([one, other])
    assert points_for(float(max_points), low) <= points_for(float(max_points), high)
