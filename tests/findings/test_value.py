"""What is expected of fields: numbers, comparisons, ranges, angles, rotations, items."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest

from grader.findings.condition import is_comparison
from grader.findings.expected import same_value
from grader.findings.fields import difference_words, unlike, words
from grader.findings.value import EXACT, NoSuchField


def quaternion(heading: float) -> dict[str, float]:
    return {"x": 0.0, "y": 0.0, "z": math.sin(heading / 2), "w": math.cos(heading / 2)}


def message(heading: float = 1.0) -> dict[str, Any]:
    return {
        "x": 0.5,
        "count": 3,
        "name": "> 0",
        "flag": True,
        "ranges": [1.0, 0.25],
        "pose": {"orientation": quaternion(heading)},
    }


def wrong(wanted: dict[str, Any], heading: float = 1.0, tolerance: Any = EXACT) -> str:
    return difference_words(unlike(message(heading), wanted, tolerance))


def float32(number: float) -> float:
    return float(struct.unpack("f", struct.pack("f", number))[0])


@pytest.mark.parametrize(
    ("wanted", "observed"),
    [
        ({"x": "> 0"}, ""),
        ({"x": ">0.5"}, "x = 0.5 instead of >0.5"),
        ({"x": ">= 0.5"}, ""),
        ({"x": "< 0.5"}, "x = 0.5 instead of < 0.5"),
        ({"x": "!= 0"}, ""),
        ({"x": "!= 0.5"}, "x = 0.5 instead of != 0.5"),
        ({"x": "0.5 .. 1"}, ""),
        ({"x": "0.6 .. 1"}, "x = 0.5 instead of 0.6 .. 1"),
        ({"x": "50 cm"}, ""),
        ({"count": "6 * x"}, ""),
        ({"count": "7 * x"}, "count = 3 instead of 7 * x"),
        ({"count": "> x"}, ""),
        ({"count + x": 3.5}, ""),
        ({"ranges[1]": 0.25}, ""),
        ({"ranges[1]": "> 1"}, "ranges[1] = 0.25 instead of > 1"),
        ({"ranges": ["> 0", "0 .. 1"]}, ""),
        ({"ranges": ["> 0", "> 1"]}, "ranges = [1.0, 0.25] instead of ['> 0', '> 1']"),
        ({"min(ranges)": "> 0.2"}, ""),
        # A text that is expected of a text is that text.
        ({"name": "> 0"}, ""),
        ({"name": "> 1"}, "name = '> 0' instead of '> 1'"),
        # What an array of the student's lacks is the student's mistake.
        ({"ranges[7]": "> 0"}, "ranges[7] = nothing instead of > 0"),
    ],
)
def test_a_text_that_is_expected_of_a_number_asks_something_of_it(
    wanted: dict[str, Any], observed: str
) -> None:
    assert wrong(wanted) == observed


@pytest.mark.parametrize("text", [">= 0.1", "<= 0.1", "0.1 .. 0.2", "0 .. 0.1", "0.1"])
def test_the_float32_of_a_bound_is_the_bound(text: str) -> None:
    assert not unlike({"x": float32(0.1)}, {"x": text}, EXACT)


@pytest.mark.parametrize("text", ["> 0.1", "< 0.1", "!= 0.1"])
def test_the_float32_of_a_bound_is_not_beyond_it(text: str) -> None:
    assert unlike({"x": float32(0.1)}, {"x": text}, EXACT)


@pytest.mark.parametrize("text", ["> 0", "< 0", "!= 0", "-1 .. 1", "0", ">= 0"])
def test_nan_is_as_asked_for_by_no_comparison(text: str) -> None:
    assert unlike({"x": math.nan}, {"x": text}, EXACT)


def test_an_angle_is_compared_on_the_circle() -> None:
    for heading in (math.pi - 0.01, 0.01 - math.pi):
        turned = {"yaw(pose.orientation)": math.pi}
        assert wrong(turned, heading, {"yaw(pose.orientation)": 0.02}) == ""
        assert wrong({"yaw(pose.orientation)": "170 deg .. 190 deg"}, heading) == ""
        assert wrong({"degrees(yaw(pose.orientation))": "170 .. 190"}, heading) == ""
        assert wrong({"yaw(pose.orientation)": "-10 deg .. 10 deg"}, heading) != ""


def test_a_quaternion_and_its_opposite_are_the_same_rotation() -> None:
    opposite = {part: -number for part, number in quaternion(1.0).items()}
    assert wrong({"pose": {"orientation": opposite}}) == ""
    assert wrong({"pose.orientation": {**opposite, "x": 0.1}}) != ""
    assert "pose.orientation.z" in wrong({"pose.orientation": {"z": opposite["z"]}})


def test_a_tolerance_of_one_field_is_not_that_of_others() -> None:
    assert wrong({"x": 0.6, "count": 3}, tolerance={"x": 0.2}) == ""
    assert wrong({"x": 0.6, "count": 4}, tolerance={"x": 0.2}) == "count = 3 instead of 4"


@pytest.mark.parametrize(
    ("wanted", "told"),
    [
        ({"x": "fast"}, "x is a number, but 'fast' is expected of it: the message has no field"),
        ({"x": "> "}, "x is a number, but '> ' is expected of it: write a number, '> 0'"),
        ({"x": "=> 3"}, "write a number, '> 0', '0.1 .. 0.5' or an expression of fields"),
        ({"x": "> ranges"}, "x is a number, but '> ranges' is expected"),
        ({"yaw(x)": 1}, r"yaw\(x\) cannot be computed: a quaternion has x, y, z and w"),
        ({"yaw(pose)": 1}, "a quaternion has x, y, z and w"),
        ({"yow(pose.orientation)": 1}, "no function 'yow'. Did you mean 'yaw'"),
        ({"pose": {"yaw(orientation)": 1}}, "outside of 'pose', with the whole paths of fields"),
        ({"flag": "> 0"}, "flag is true or false, but a text is expected of it"),
    ],
)
def test_what_an_assignment_cannot_ask_is_told(wanted: dict[str, Any], told: str) -> None:
    with pytest.raises(NoSuchField, match=told):
        unlike(message(), wanted, EXACT)


def test_a_parameter_is_compared_with_a_text_only_if_that_is_a_comparison() -> None:
    assert same_value("0.1 .. 0.5", 0.3) and same_value("> 0", 1)
    assert not same_value("> 0", -1) and not same_value("> 0", True)
    assert not same_value("1.0", 1.0) and not same_value("1.0", "1") and same_value("1.0", "1.0")


def test_what_is_expected_is_written_as_the_assignment_has_it() -> None:
    expected = {"x": "> 0", "y": "0 .. 1", "name": "Ada", "p": {"z": 1}}
    assert words(expected) == "x > 0, y = 0 .. 1, name = 'Ada', p.z = 1"


def test_a_range_from_high_to_low_is_refused() -> None:
    with pytest.raises(ValueError, match="is above the highest"):
        unlike(message(), {"x": "5 .. 1"}, EXACT)
    assert not is_comparison("5 .. 1")


@pytest.mark.parametrize(
    ("expected", "right"),
    [
        ({"points": [{"x": 0.0, "y": 1}, {"x": 0.1, "y": "> 1"}]}, True),
        ({"points": [{"x": 0.0, "y": 1.0}, {"x": 0.2, "y": 2.0}]}, False),
        ({"points": [{"x": 0.0, "y": 1.0}]}, False),
        ({"words": ["hello", {"contains": "WORLD"}]}, True),
        ({"words": ["hello", {"contains": "moon"}]}, False),
        ({"words": ["hello", {"x": 0.0}]}, False),
    ],
)
def test_an_array_of_messages_or_texts_is_compared_item_by_item(
    expected: dict[str, Any], right: bool
) -> None:
    points = [{"x": 0.0, "y": 1.0}, {"x": float32(0.1), "y": 2.0}]
    observed = {"points": points, "words": ["hello", "the world"]}
    assert (not unlike(observed, expected, EXACT)) is right
