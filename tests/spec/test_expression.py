"""Expressions of fields: read without being executed, and computed."""

from __future__ import annotations

import math
from typing import Any

import pytest

from grader.spec.expression import Expression

FIELDS = {
    "linear.x": 3.0,
    "linear.y": 4.0,
    "linear": {"x": 3.0, "y": 4.0},
    "ranges": [1.0, 2.0, 0.5],
    "ranges[1]": 2.0,
    "none": [],
    "q": {"x": 0.0, "y": 0.0, "z": math.sin(0.5), "w": math.cos(0.5)},
    "rolled": {"x": math.sin(0.5), "y": 0.0, "z": 0.0, "w": math.cos(0.5)},
    "pitched": {"x": 0.0, "y": math.sin(0.5), "z": 0.0, "w": math.cos(0.5)},
}


def value(text: str) -> Any:
    return Expression.of(text).value(FIELDS.__getitem__)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("linear.x", 3.0),
        ("ranges[1]", 2.0),
        ("-linear.x + 2 * (linear.y - 1) / 4", -1.5),
        ("hypot(linear.x, linear.y)", 5.0),
        ("norm(linear)", 5.0),
        ("abs(linear.x - linear.y)", 1.0),
        ("min(ranges) + max(ranges) + sum(ranges) + len(ranges)", 9.0),
        ("yaw(q)", 1.0),
        ("degrees(yaw(q))", math.degrees(1.0)),
        ("roll(rolled)", 1.0),
        ("pitch(pitched)", 1.0),
        ("90 deg", math.pi / 2),
        ("-0.5 m", -0.5),
        ("pi / 2", math.pi / 2),
        ("1e-3", 1e-3),
    ],
)
def test_an_expression_is_computed_from_fields_and_quantities(text: str, wanted: float) -> None:
    assert value(text) == pytest.approx(wanted)


@pytest.mark.parametrize("text", ["1 / (linear.x - 3)", "sqrt(-linear.x)", "min(none)"])
def test_what_has_no_result_is_nan_and_no_crash(text: str) -> None:
    assert math.isnan(value(text))


@pytest.mark.parametrize("text", ["yaw(linear)", "abs(linear)", "hypot(linear.x, q)"])
def test_a_field_of_another_kind_is_told(text: str) -> None:
    with pytest.raises(TypeError):
        value(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("__import__('os')", "no function '__import__'"),
        ("sine(x)", "no function 'sine'. Did you mean 'sin'?"),
        ("x ** 99", r"'x \*\* 99' is not allowed"),
        ("[x for x in y]", "is not allowed"),
        ("x.__class__()", "is not allowed"),
        ("f(x)(y)", "is not allowed"),
        ("min(x, key=y)", "is not allowed"),
        ("True + 1", "is not allowed"),
        ("x if y else z", "is not allowed"),
        ("'a' + 'b'", "is not allowed"),
        ("x[-1]", "is not allowed"),
        ("x +", "cannot be read"),
        ("ranges 0", "cannot be read"),
        ("", "cannot be read"),
        ("90 degrees", "unknown unit 'degrees'"),
        ("(" * 500, "cannot be read"),
    ],
)
def test_what_is_not_in_the_table_is_refused_and_never_run(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Expression.of(text)


def test_an_expression_knows_its_fields_each_once() -> None:
    assert Expression.of("hypot(a.x, b[2].y) / a.x + pi").fields == ("a.x", "b[2].y")


@pytest.mark.parametrize(
    ("text", "circle"),
    [
        ("yaw(q)", math.tau),
        ("-yaw(q) + 0.5", math.tau),
        ("degrees(yaw(a) - yaw(b))", 360.0),
        ("atan2(y, x)", math.tau),
        ("abs(yaw(q))", 0.0),
        ("yaw(q) / 2", 0.0),
        ("linear.x", 0.0),
    ],
)
def test_an_angle_is_known_to_go_all_around(text: str, circle: float) -> None:
    assert Expression.of(text).circle == pytest.approx(circle)
