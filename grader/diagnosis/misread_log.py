"""What a wrong number in the log stands for: another field, a rounded value, a wrong sign."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from grader.checks.value import leaves
from grader.checks.wording import code, listing
from grader.measure.printed import Wanted, shows

_MOST_NAMED = 2
# One of hundreds of beams has nearly every distance, and so tells nothing; a covariance has 36.
_LONGEST = 36


def what_is_shown(
    printed: Sequence[float], wanted: Wanted, missing: Sequence[str], decimals: int
) -> str:
    """Say in a clause what a line shows instead of the values, or nothing.

    Args:
        decimals: How many decimals must be right.

    Returns:
        Such as ``shows `ranges[180]```; empty where no relation is seen.
    """
    for path in missing:
        relations = (_relation(number, wanted.values[path], decimals) for number in printed)
        relation = next(filter(None, relations), "")
        if relation:
            return f"shows {code(path)} {relation}"
    named = [name for number in printed for name in _names(number, wanted, decimals)]
    first = list(dict.fromkeys(named))[:_MOST_NAMED]
    return f"shows {listing(map(code, first), last='or')}" if first else ""


def _relation(number: float, value: float, decimals: int) -> str:
    """How a number is made of a value."""
    if not (math.isfinite(number) and math.isfinite(value)) or not (number and value):
        return ""
    if number in (round(value, 1), round(value), math.trunc(value)):
        return "with fewer decimals"
    if number * value < 0.0 and shows(number, -value, decimals):
        return "with the opposite sign"
    return ""


def _names(number: float, wanted: Wanted, decimals: int) -> Iterator[str]:
    """Other fields of the message, and statistics of its arrays, that a number stands for."""
    value = wanted.message.value
    fields = {
        path: float(item)
        for path, item in leaves(value).items()
        if isinstance(item, int | float) and path not in wanted.values
    }
    sizes = Counter(path.partition("[")[0] for path in fields)
    few = {path: it for path, it in fields.items() if sizes[path.partition("[")[0]] <= _LONGEST}
    for name, item in {**_statistics(value), **_spokes(fields), **few}.items():
        # Among 36 covariances a zero is always found, and infinity is every beam without an echo.
        tells = math.isfinite(number) and (number or "covariance" not in name)
        if tells and shows(number, item, decimals):
            yield name


def _statistics(value: Mapping[str, object]) -> dict[str, float]:
    """Least and greatest of each array of numbers."""
    found = {}
    for name, item in value.items():
        if isinstance(item, Sequence) and not isinstance(item, str) and len(item) > 1:
            finite = [x for x in item if isinstance(x, int | float) and math.isfinite(x)]
            if finite:
                found[f"min({name})"] = float(min(finite))
                found[f"max({name})"] = float(max(finite))
    return found


def _spokes(fields: Mapping[str, float]) -> dict[str, float]:
    """Beams that are taken for the one ahead: the middle one, and those at the sides."""
    count = sum(path.startswith("ranges[") for path in fields) + 1
    paths = [f"ranges[{index}]" for index in (count // 2, count // 4, 3 * count // 4)]
    return {path: fields[path] for path in paths if path in fields}
