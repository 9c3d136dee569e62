"""A tolerance is a share or a time."""

import pytest

from grader.checks.tolerance import TimeTolerance, parse_time_tolerance


@pytest.mark.parametrize(
    ("text", "seconds", "words"),
    [("5 %", 0.015, "5 %"), (0.05, 0.015, "5 %"), ("15 ms", 0.015, "15 ms"), (0, 0.0, "0 %")],
)
def test_tolerances_of_300_ms_are_as_written(text, seconds, words):
    tolerance = parse_time_tolerance(text)
    assert tolerance.of(0.3) == pytest.approx(seconds)
    assert str(tolerance) == words


def test_a_tolerance_stays_what_it_is():
    tolerance = TimeTolerance(0.1, relative=True)
    assert parse_time_tolerance(tolerance) is tolerance


@pytest.mark.parametrize("text", ["5 m", "wide", None, True, "5 % 3 ms"])
def test_anything_else_is_refused(text):
    with pytest.raises(ValueError, match="neither a share such as '5 %' nor a time"):
        parse_time_tolerance(text)


@pytest.mark.parametrize("text", ["-5 %", "-15 ms"])
def test_a_negative_one_is_refused(text):
    with pytest.raises(ValueError, match="is negative"):
        parse_time_tolerance(text)
