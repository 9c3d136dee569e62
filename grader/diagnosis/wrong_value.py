"""Messages that have other values, or are too many."""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise, product
from typing import Any

from grader.diagnosis.explanation import Symptom, explanation
from grader.findings.expected import Difference, same
from grader.findings.words import value_text, worded

# How many times too large -> what that is. People type 57.3 and 3.14: three digits must do.
_FACTORS = {
    -1.0: "has the wrong sign",
    math.degrees(1.0): "is in degrees: ROS has angles in radians (REP-103)",
    math.radians(1.0): "was taken for degrees and converted, but is in radians already",
    **{10.0**n: f"is {10**n} times too large: look at the units" for n in (1, 2, 3)},
    **{0.1**n: f"is {10**n} times too small: look at the units" for n in (1, 2, 3)},
}
_FACTOR_TOLERANCE = 2e-3
# Python 3.11 has the number of digits of a negative integer with a minus.
_LEAST_NEGATIVE = (1 << 64) - (1 << 8)


@dataclass(frozen=True)
class WrongValue(Symptom[str]):
    """A message does not have the expected values.

    The explanations answer with a clause.

    Attributes:
        wrong: At least one difference.
        observed: All leaves of the message.
        tolerance: Largest difference of two equal numbers.
        always: No other message is right.
        series: What the first of the wrong fields is in all messages.
    """

    wrong: tuple[Difference, ...]
    observed: Mapping[str, Any]
    tolerance: float
    always: bool = True
    series: Sequence[Any] = ()

    @property
    def numbers(self) -> list[Difference]:
        """Differences between numbers."""
        return [one for one in self.wrong if _is_number(one.expected) and _is_number(one.observed)]

    @property
    def wanted(self) -> list[Difference]:
        """Those where another number than 0 is expected."""
        return [one for one in self.numbers if one.expected != 0]


@explanation(WrongValue)
def added_up(symptom: WrongValue) -> str | None:
    """A field that should stay the same grows by the same step in every message."""
    expected, series = symptom.wrong[0].expected, symptom.series
    if not _is_number(expected) or len(series) < 3 or not all(map(_is_number, series)):
        return None
    steps = [after - before for before, after in pairwise(series)]
    step = steps[0]
    if not math.isfinite(step) or step == 0:
        return None
    if not all(math.isclose(other, step, rel_tol=1e-6) for other in steps):
        return None
    return f"{symptom.wrong[0].field} grows from message to message, as if added up"


@explanation(WrongValue)
def integer_in_a_float_field(symptom: WrongValue) -> str | None:
    """A float field holds an integer, a text or a numpy.float32, which ROS misreads."""
    bad = next((one for one in symptom.numbers if was_integer(one.observed)), None)
    if bad is None:
        return None
    return misread_words(bad.field)


def misread_words(field: str) -> str:
    """What is wrong with a float field that has no number of the program's."""
    return worded(
        python=f"{field} is a float field, but an integer, a text or a numpy.float32 was put into "
        "it, which ROS misreads",
        cpp=f"{field} has what lay in memory: a variable was never given a value",
    )


@explanation(WrongValue)
def not_a_number(symptom: WrongValue) -> str | None:
    """A number is inf or NaN: a division by zero, or the square root of a negative number."""
    bad = next((one for one in symptom.numbers if not math.isfinite(one.observed)), None)
    if bad is None or not math.isfinite(bad.expected):
        return None
    what = "not a number" if math.isnan(bad.observed) else "infinite"
    return f"{bad.field} is {what}: look for a division by zero, and for a range of inf or nan"


@explanation(WrongValue)
def fields_swapped(symptom: WrongValue) -> str | None:
    """Two fields are swapped."""
    for one, other in combinations(symptom.wanted, 2):
        first = same(one.expected, other.observed, symptom.tolerance)
        if first and same(other.expected, one.observed, symptom.tolerance):
            return f"{one.field} and {other.field} are swapped"
    return None


@explanation(WrongValue)
def every_number_zero(symptom: WrongValue) -> str | None:
    """Every number is zero, as in a new message."""
    numbers = [value for value in symptom.observed.values() if _is_number(value)]
    if not symptom.wanted or not numbers or any(numbers):
        return None
    others = "" if symptom.always else ", although others are right"
    return f"every number in it is zero, as in a new message{others}"


@explanation(WrongValue)
def in_another_field(symptom: WrongValue) -> str | None:
    """The value is in another field."""
    for one, other in product(symptom.wanted, symptom.numbers):
        if other is not one and same(one.expected, other.observed, symptom.tolerance):
            return f"the {value_text(one.expected)} stands in {other.field} instead of {one.field}"
    return None


@explanation(WrongValue)
def wrong_sign_or_unit(symptom: WrongValue) -> str | None:
    """The sign is wrong, the value is 10, 100 or 1000 times too large, or it is in degrees."""
    for one in symptom.wanted:
        if words := factor_words(one.observed, one.expected):
            return f"{one.field} {words}"
    return None


def factor_words(observed: float, expected: float) -> str:
    """How a number differs from another, such as ``is 100 times too large``; or nothing."""
    for factor, words in _FACTORS.items():
        if expected and math.isclose(observed, factor * expected, rel_tol=_FACTOR_TOLERANCE):
            return words
    return ""


def was_integer(number: Any) -> bool:
    """Whether a float is what rclpy makes of an integer that was put into a float field.

    rclpy does not check the types of fields (unless ROS_PYTHON_CHECK_FIELDS=1), and takes the
    bits of Python's integer for a float: a number next to nothing, such as 5e-324, or the NaN of
    the bits of -1, which no computation makes.
    """
    return isinstance(number, float) and (
        0.0 < abs(number) < sys.float_info.min or _bits(number) >= _LEAST_NEGATIVE
    )


def _bits(number: float) -> int:
    (bits,) = struct.unpack("<Q", struct.pack("<d", number))
    return int(bits)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
