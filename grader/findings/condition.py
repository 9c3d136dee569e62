"""What an assignment asks of a number: one like another, or ``> 0``, ``!= 0``, ``0.1 .. 0.5``."""

from __future__ import annotations

import math
import operator
import re
import struct
from collections.abc import Callable
from functools import cache

from grader.spec.expression import Expression, Find

EXACT = 1e-9
_FLOAT32_MAX = 3.4028234663852886e38

_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}
_FORM = re.compile(r"(>=|<=|>|<|!=|)\s*(.*)", re.DOTALL)
_BETWEEN = ".."


def difference(wanted: float, observed: float, circle: float = 0.0) -> float:
    """How far a number is off; of an angle, with a full turn as ``circle``, on the circle."""
    found = observed - wanted
    return math.remainder(found, circle) if circle and math.isfinite(found) else found


def is_near(wanted: float, observed: float, tolerance: float, circle: float = 0.0) -> bool:
    """Whether a number is the wanted one; NaN is the same as NaN.

    A float32 field holds the float32 that is nearest to the wanted number: that is the same.
    """
    if math.isnan(wanted) or math.isnan(observed):
        return math.isnan(wanted) and math.isnan(observed)
    if wanted == observed or abs(difference(wanted, observed, circle)) <= tolerance:
        return True
    in_range = abs(wanted) <= _FLOAT32_MAX
    return in_range and observed == struct.unpack("f", struct.pack("f", wanted))[0]


@cache
def _read(text: str) -> tuple[str, tuple[Expression, ...]]:
    """A sign, perhaps none, and one bound; or two bounds of a range."""
    low, between, high = text.partition(_BETWEEN)
    if not between:
        match = _FORM.fullmatch(text.strip())
        assert match is not None
        return match[1], (Expression.of(match[2]),)
    ends = Expression.of(low.strip()), Expression.of(high.strip())
    fixed = [end.value(str) for end in ends if not end.fields]
    if fixed != sorted(fixed):
        raise ValueError(f"the lowest value of {text!r} is above the highest")
    return _BETWEEN, ends


def is_comparison(text: str) -> bool:
    """Whether a text is a comparison or a range, and so not just another way to write a value."""
    try:
        return bool(_read(text)[0])
    except ValueError:
        return False


def meets(text: str, observed: float, tolerance: float, find: Find, circle: float = 0.0) -> bool:
    """Whether a number is as a text asks; NaN only if NaN is asked for.

    Args:
        tolerance: For a number that is, or is not, the same: other bounds are exact.
        circle: Of an angle a full turn.

    Raises:
        ValueError: The text asks nothing of a number.
        TypeError: It asks for something that is no number.
    """
    sign, bounds = _read(text)
    numbers = [bound.value(find) for bound in bounds]
    if not all(isinstance(number, int | float) for number in numbers):
        raise TypeError("not a number")
    if sign == _BETWEEN:
        return _is_between(numbers[0], numbers[1], observed, circle)
    bound = numbers[0]
    if sign == "":
        return is_near(bound, observed, tolerance, circle)
    if sign == "!=":
        return not math.isnan(observed) and not is_near(bound, observed, tolerance, circle)
    # The float32 that is nearest to a bound is the bound.
    if is_near(bound, observed, EXACT if "=" in sign else 0.0):
        return "=" in sign
    return _COMPARISONS[sign](observed, bound)


def _is_between(low: float, high: float, observed: float, circle: float) -> bool:
    """Whether a number is in a range with its ends; of an angle, on the way from low to high."""
    if is_near(low, observed, EXACT, circle) or is_near(high, observed, EXACT, circle):
        return True
    if circle:
        observed = low + (observed - low) % circle
    return low <= observed <= high
