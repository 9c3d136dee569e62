"""What an assignment asks of a number: one like another, or ``> 0``, ``!= 0``, ``0.1 .. 0.5``."""

from __future__ import annotations

import math
import operator
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from grader.spec.expression import Expression, Find

EXACT = 1e-9
_FLOAT32_MAX = 3.4028234663852886e38

_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    **{">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt},
    **{"!=": operator.ne, "": operator.eq},
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


@dataclass(frozen=True)
class Condition:
    """What a text asks of a number.

    Attributes:
        sign: ``>``, ``>=``, ``<``, ``<=``, ``!=``, ``..`` for a range with both its ends, or
            nothing for a number that is the same.
    """

    sign: str
    bounds: tuple[Expression, ...]

    @classmethod
    @cache
    def of(cls, text: str) -> Condition:
        """Read one; a ValueError says what is wrong."""
        low, between, high = text.partition(_BETWEEN)
        if between:
            ends = Expression.of(low.strip()), Expression.of(high.strip())
            fixed = [end.value(str) for end in ends if not end.fields]
            if fixed != sorted(fixed):
                raise ValueError(f"the lowest value of {text!r} is above the highest")
            return cls(_BETWEEN, ends)
        match = _FORM.fullmatch(text.strip())
        assert match is not None
        return cls(match[1], (Expression.of(match[2]),))

    def holds(self, observed: float, tolerance: float, find: Find, circle: float = 0.0) -> bool:
        """Whether an observed number is as asked for; NaN only if NaN is asked for.

        Args:
            tolerance: For a number that is, or is not, the same: other bounds are exact.
            circle: Of an angle a full turn.
        """
        numbers = [bound.value(find) for bound in self.bounds]
        if not all(isinstance(number, int | float) for number in numbers):
            raise TypeError("not a number")
        first, last = numbers[0], numbers[-1]
        if self.sign == _BETWEEN:
            ends = any(is_near(end, observed, EXACT, circle) for end in numbers)
            turned = first + (observed - first) % circle if circle else observed
            return ends or first <= turned <= last
        if self.sign in ("", "!="):
            same = is_near(first, observed, tolerance, circle)
            return same if not self.sign else not same and not math.isnan(observed)
        # The float32 that is nearest to a bound is the bound.
        on_the_bound = is_near(first, observed, EXACT if "=" in self.sign else 0.0)
        return "=" in self.sign if on_the_bound else _COMPARISONS[self.sign](observed, first)


def is_comparison(text: str) -> bool:
    """Whether a text is a comparison or a range, and so not just another way to write a value."""
    try:
        return bool(Condition.of(text).sign)
    except ValueError:
        return False
