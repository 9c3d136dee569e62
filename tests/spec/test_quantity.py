"""Quantities carry units in YAML and are SI in the program."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.spec.unit import UNITS, Dimension, format_duration, parse_quantity


@pytest.mark.parametrize(
    ("text", "dimension", "si"),
    [
        ("300 ms", Dimension.TIME, 0.3),
        (" 2 min ", Dimension.TIME, 120.0),
        ("1e3 us", Dimension.TIME, 1e-3),
        ("10 Hz", Dimension.FREQUENCY, 10.0),
        ("-0.2 m", Dimension.LENGTH, -0.2),
        ("180 deg", Dimension.ANGLE, math.pi),
        ("90 deg/s", Dimension.ANGULAR_SPEED, math.pi / 2),
        ("5 %", Dimension.RATIO, 0.05),
        (0.05, Dimension.RATIO, 0.05),
        ("0.05", Dimension.RATIO, 0.05),
        ("100 %", Dimension.RATIO, 1.0),
        ("64 MiB", Dimension.SIZE, 67108864.0),
        (0, Dimension.TIME, 0.0),
        ("0", Dimension.LENGTH, 0.0),
    ],
)
def test_quantities_are_read_in_si(text: str | float, dimension: Dimension, si: float) -> None:
    assert parse_quantity(text, dimension) == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "dimension", "said"),
    [
        (5, Dimension.TIME, "5 has no unit: write for example '5 s'"),
        ("5", Dimension.ANGLE, "'5' has no unit: write for example '5 rad'"),
        # Its author means 5 %, and would tolerate 500 %.
        (5, Dimension.RATIO, "5 has no unit: did you mean '5 %'?"),
        (1, Dimension.RATIO, "1 has no unit: did you mean '1 %'?"),
        ("5 m", Dimension.TIME, "'m' is a unit of length, but a time is needed here (s, ms, "),
        ("3 Hz", Dimension.ANGLE, "'Hz' is a unit of frequency, but an angle is needed here"),
        ("5 parsec", Dimension.LENGTH, "unknown unit 'parsec': a length has one of m, cm, mm, km"),
        ("3 seconds", Dimension.TIME, "unknown unit 'seconds'. Did you mean 's'?"),
        ("90°", Dimension.ANGLE, "unknown unit '°'. Did you mean 'deg'?"),
        ("1,5 s", Dimension.TIME, "'1,5 s' is not a time: write a number and a unit"),
        ("12:30", Dimension.TIME, "'12:30' is not a time"),
        ("", Dimension.TIME, "'' is not a time"),
        (math.nan, Dimension.RATIO, "nan is not a ratio"),
        ("1e999 s", Dimension.TIME, "'1e999 s' is not finite"),
        (True, Dimension.TIME, "expected a time with a unit (s, ms, us, ns, min)"),
        (None, Dimension.ANGLE, "expected an angle with a unit (rad, deg)"),
    ],
)
def test_what_is_no_quantity_says_what_is_allowed(
    text: object, dimension: Dimension, said: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        parse_quantity(text, dimension)  # type: ignore[arg-type]


_dimensions = st.sampled_from(Dimension)


@given(st.text() | st.integers() | st.floats(), _dimensions)
def test_anything_is_read_as_a_finite_number_or_refused(
    text: str | float, dimension: Dimension
) -> None:
    try:
        assert math.isfinite(parse_quantity(text, dimension))
    except ValueError as error:
        assert str(error)


@given(st.floats(-1e6, 1e6), _dimensions, st.data())
def test_every_unit_of_a_dimension_is_accepted(
    number: float, dimension: Dimension, data: st.DataObject
) -> None:
    unit, factor = data.draw(st.sampled_from(sorted(UNITS[dimension].items())))
    assert parse_quantity(f"{number!r} {unit}", dimension) == pytest.approx(number * factor)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (0.3, "300 ms"),
        (1.25, "1.25 s"),
        (-0.0125, "-12.5 ms"),
        (0.000062, "62 us"),
        (3e-9, "3 ns"),
        (300.0, "5 min"),
        (4e-12, "0.004 ns"),
    ],
)
def test_times_are_written_for_people(seconds: float, text: str) -> None:
    assert format_duration(seconds) == text


@given(st.floats(1e-9, 1e5))
def test_a_written_time_reads_as_the_same_to_four_digits(seconds: float) -> None:
    assert parse_quantity(format_duration(seconds), Dimension.TIME) == pytest.approx(
        seconds, rel=6e-4
    )
