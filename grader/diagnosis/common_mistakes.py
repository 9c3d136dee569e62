"""The classic slips behind a wrong message: swapped fields, wrong sign, wrong unit."""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from grader.checks.value import Difference, same
from grader.checks.wording import value_text

_FACTORS = {1000.0: "1000 times", 100.0: "100 times", 10.0: "10 times"}
_FACTOR_TOLERANCE = 1e-6
# As bits of a numpy.float32 this is a number next to nothing, 1e-38.
_MOST_DIGITS = 1 << 23
# Python 3.11 has the number of digits of a negative integer with a minus.
_LEAST_NEGATIVE = (1 << 64) - (1 << 8)


def explain(
    wrong: tuple[Difference, ...],
    observed: Mapping[str, Any],
    tolerance: float,
    *,
    always: bool = True,
) -> str:
    """Say which slip explains the differences, or nothing.

    Args:
        wrong: At least one difference.

    Returns:
        A clause such as ``linear.x and angular.z are swapped``, or an empty text.
    """
    numbers = [item for item in wrong if _is_number(item.expected) and _is_number(item.observed)]
    if not numbers:
        return ""
    wanted = [item for item in numbers if item.expected != 0]
    return (
        _integer(numbers)
        or _not_a_number(numbers)
        or _swapped(numbers, tolerance)
        or _all_zero(wanted, observed, always)
        or _moved(wanted, numbers, tolerance)
        or _scaled(wanted, tolerance)
    )


def was_integer(number: Any) -> bool:
    """Whether a float is what rclpy makes of an integer that was put into a float field.

    rclpy does not check the types of fields (unless ROS_PYTHON_CHECK_FIELDS=1), and takes the
    bits of Python's integer for a float: a number next to nothing, such as 5e-324, or the NaN of
    the bits of -1, which no computation makes.
    """
    return isinstance(number, float) and (
        0.0 < abs(number) < sys.float_info.min or _bits(number) >= _LEAST_NEGATIVE
    )


def what_was_put(number: float) -> str:
    """What was put into a float field in place of a float, for one that :func:`was_integer`.

    Of an integer rclpy takes the number of its digits for a float, or a small integer itself; of
    a numpy.float32 all of its bits, the exponent among them; of a text how long it is.
    """
    bits = _bits(number)
    if bits < _LEAST_NEGATIVE and _bits(abs(number)) > _MOST_DIGITS:
        return "a numpy.float32"
    # Digits are counted from 1 in Python 3.11, in eights in 3.12 with 2 for a negative integer.
    return "an integer" if bits <= 2 or bits >= _LEAST_NEGATIVE or bits % 8 in (0, 2) else "a text"


def _bits(number: float) -> int:
    (bits,) = struct.unpack("<Q", struct.pack("<d", number))
    return int(bits)


def accumulates(expected: Any, series: list[Any]) -> bool:
    """Whether a field that should stay the same grows by the same step in every message."""
    if not _is_number(expected) or len(series) < 3 or not all(map(_is_number, series)):
        return False
    steps = [after - before for before, after in pairwise(series)]
    step = steps[0]
    if not math.isfinite(step) or step == 0:
        return False
    return all(math.isclose(other, step, rel_tol=1e-6) for other in steps)


def _integer(numbers: list[Difference]) -> str:
    bad = next((item for item in numbers if was_integer(item.observed)), None)
    if bad is None:
        return ""
    put = what_was_put(bad.observed)
    return f"{bad.field} is a float field, but {put} was put into it, which ROS misreads"


def _not_a_number(numbers: list[Difference]) -> str:
    bad = next((item for item in numbers if not math.isfinite(item.observed)), None)
    if bad is None or not math.isfinite(bad.expected):
        return ""
    if math.isnan(bad.observed):
        return f"{bad.field} is not a number: look for 0/0 or the root of a negative number"
    return f"{bad.field} is infinite: look for a division by zero or a range that sees nothing"


def _swapped(numbers: list[Difference], tolerance: float) -> str:
    for index, one in enumerate(numbers):
        for other in numbers[index + 1 :]:
            if same(one.expected, other.observed, tolerance) and same(
                other.expected, one.observed, tolerance
            ):
                if one.expected and other.expected:
                    return f"{one.field} and {other.field} are swapped"
                full, empty = (one, other) if one.expected else (other, one)
                return _stands_in(full, empty.field)
    return ""


def _moved(wanted: list[Difference], numbers: list[Difference], tolerance: float) -> str:
    for item in wanted:
        for other in numbers:
            if other is not item and same(item.expected, other.observed, tolerance):
                return _stands_in(item, other.field)
    return ""


def _stands_in(item: Difference, field: str) -> str:
    return f"the {value_text(item.expected)} stands in {field} instead of {item.field}"


def _all_zero(wanted: list[Difference], observed: Mapping[str, Any], always: bool) -> str:
    numbers = [value for value in observed.values() if _is_number(value)]
    if wanted and numbers and not any(numbers):
        others = "" if always else ", although others are right"
        return f"every number in it is zero, as in a new message{others}"
    return ""


def _scaled(wanted: list[Difference], tolerance: float) -> str:
    for item in wanted:
        if not item.observed:
            continue
        ratio = item.observed / item.expected
        if same(item.expected, -item.observed, tolerance):
            return f"the sign of {item.field} is wrong"
        for factor, words in _FACTORS.items():
            if math.isclose(ratio, factor, rel_tol=_FACTOR_TOLERANCE):
                return f"{item.field} is {words} too large: a slip of units or of the point"
            if math.isclose(ratio, 1.0 / factor, rel_tol=_FACTOR_TOLERANCE):
                return f"{item.field} is {words} too small: a slip of units or of the point"
        # Three digits, for people type 57.3 and 3.14.
        if math.isclose(ratio, math.degrees(1.0), rel_tol=2e-3):
            return f"{item.field} is in degrees: ROS has angles in radians (REP-103)"
        if math.isclose(ratio, math.radians(1.0), rel_tol=2e-3):
            return f"{item.field} was taken for degrees and converted, but is in radians already"
    return ""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
