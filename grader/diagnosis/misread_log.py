"""What a wrong number in the log stands for: another field, another unit, too few decimals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from statistics import mean

from grader.checks.value import leaves
from grader.checks.wording import code, listing
from grader.measure.echo import Wanted
from grader.measure.printed import shows

_FACTORS = (
    (100.0, "100 times the value, as in centimetres,"),
    (1000.0, "1000 times the value, as in millimetres,"),
)
_MOST_NAMED = 2
# How many beams to either side of the one ahead a mean is usually taken over.
_SIDES = (1, 2, 3, 5, 10, 15, 20, 30)
# A covariance has 36 numbers, most of them 0.
_LONGEST = 36


def explain(printed: Sequence[float], wanted: Wanted, missing: Sequence[str], decimals: int) -> str:
    """Say in a clause what a line shows instead of the values, or nothing.

    Args:
        decimals: How many decimals must be right.

    Returns:
        Such as ``shows `ranges[180]```; empty where no relation is seen.
    """
    for path in missing:
        value = wanted.values[path]
        for number in printed:
            relation = _relation(number, value, decimals)
            if relation:
                return f"shows {relation.format(path=code(path))}"
    likely = _likely(wanted)
    others = [name for number in printed for name in _names(number, likely, decimals)]
    named = list(dict.fromkeys(others))[:_MOST_NAMED]
    return f"shows {listing(map(code, named), last='or')}" if named else ""


def _relation(number: float, value: float, decimals: int) -> str:
    """How a number is made of a value."""
    if not (math.isfinite(number) and math.isfinite(value)) or not value:
        return ""
    for kept in (1, 0):
        if number and math.isclose(number, round(value, kept), abs_tol=1e-9):
            words = "1 decimal" if kept else "no decimals"
            return f"{{path}} rounded to {words}"
    if number and number == math.trunc(value):
        return "{path} cut off at the decimal point"
    if number * value < 0.0 and shows(number, -value, decimals):
        return "{path} with the opposite sign"
    if value.is_integer() and abs(number - value) == 1.0:
        return "{path} plus 1" if number > value else "{path} minus 1"
    for factor, words in _FACTORS:
        if math.isclose(number, factor * value, rel_tol=0.005):
            return f"{words} of {{path}}"
    return ""


def _names(number: float, likely: Sequence[tuple[str, float]], decimals: int) -> Iterator[str]:
    """Those that a number stands for.

    Zeros are in nearly every message, and tell nothing unless they are all there is. Nor does
    infinity, which every beam shows that meets nothing.
    """
    if not math.isfinite(number):
        return
    for label, value in likely:
        if shows(number, value, decimals) and _tells(number, label):
            yield label


def _likely(wanted: Wanted) -> list[tuple[str, float]]:
    """Fields of a message, and statistics of its arrays, that are shown by mistake.

    The likeliest come first. One of hundreds of beams has nearly every distance, and so tells
    nothing.
    """
    fields = leaves(wanted.message.value)
    numeric = {
        path: float(value)
        for path, value in fields.items()
        if isinstance(value, int | float) and path not in wanted.values
    }
    many = _in_long_arrays(numeric)
    few = {path: value for path, value in numeric.items() if path not in many}
    return [
        *_statistics(wanted.message.value),
        *_spokes(numeric),
        *few.items(),
        *_means_ahead(wanted.message.value),
    ]


def _in_long_arrays(paths: Iterable[str]) -> set[str]:
    """Elements of arrays that are too long for one of them to be found by its value."""
    by_array: dict[str, list[str]] = {}
    for path in paths:
        by_array.setdefault(path.partition("[")[0], []).append(path)
    return {path for own in by_array.values() if len(own) > _LONGEST for path in own}


def _tells(number: float, label: str) -> bool:
    # Among 36 covariances a zero is always found.
    return bool(number) or "covariance" not in label


def _statistics(value: Mapping[str, object]) -> Iterator[tuple[str, float]]:
    """Least and greatest of each array of numbers."""
    for name, item in value.items():
        if isinstance(item, Sequence) and not isinstance(item, str) and len(item) > 1:
            finite = [x for x in item if isinstance(x, int | float) and math.isfinite(x)]
            if finite:
                yield f"min({name})", float(min(finite))
                yield f"max({name})", float(max(finite))


def _spokes(numeric: Mapping[str, float]) -> Iterator[tuple[str, float]]:
    """Beams that are taken for the one ahead: the middle one, those at the sides, the next ones."""
    beams = [path for path in numeric if path.startswith("ranges[")]
    count = len(beams)
    quarters = [index * (count + 1) // share for share in (2, 4) for index in range(1, share)]
    # The one ahead, which should be shown, is not among them.
    for index in (*quarters, 1, count):
        path = f"ranges[{index}]"
        if path in numeric:
            yield path, numeric[path]


def _means_ahead(value: Mapping[str, object]) -> Iterator[tuple[str, float]]:
    """Means of the beams about the first one, which looks ahead."""
    ranges = value.get("ranges")
    if not isinstance(ranges, Sequence) or isinstance(ranges, str):
        return
    # What a type of another kind calls so may be no numbers.
    measured = [isinstance(beam, int | float) and math.isfinite(beam) for beam in ranges]
    for sides in _SIDES:
        beams = [*ranges[: sides + 1], *ranges[-sides:]]
        if len(beams) < len(ranges) and all((*measured[: sides + 1], *measured[-sides:])):
            yield f"mean(ranges[-{sides}] ... ranges[{sides}])", mean(beams)
