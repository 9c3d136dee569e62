"""Values of messages, field by field, against what an assignment expects of them."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator

from grader.spec.nearest_name import did_you_mean

EXACT = 1e-9
"""Largest difference of two numbers that are meant to be the same."""

Tolerance = float | Mapping[str, float]
"""Largest difference of two numbers: of every field, or by path, where others are exact."""

FLOAT32_MAX = 3.4028234663852886e38

_NAME = r"[A-Za-z][A-Za-z0-9_]*(?:\[[0-9]{1,9}\])*"
_PATH = re.compile(rf"{_NAME}(?:\.{_NAME})*")
_STEP = re.compile(r"[A-Za-z0-9_]+")


def _field_path(text: str) -> str:
    if not _PATH.fullmatch(text):
        raise ValueError(
            f"{text!r} is not a field: write its path, such as 'pose.pose.position.x' or "
            "'ranges[0]'"
        )
    return text


FieldPath = Annotated[str, AfterValidator(_field_path)]


class NoSuchField(ValueError):
    """The expected value names a field that the message does not have, or of another kind."""


@dataclass(frozen=True)
class Difference:
    """A field, such as ``linear.x`` or ``data[2]``, that does not have the expected value."""

    field: str
    expected: Any
    observed: Any


def leaves(value: Any, path: str = "") -> dict[str, Any]:
    """Flatten a message: path of every leaf -> its value. An empty list is a leaf."""
    if isinstance(value, Mapping):
        inner = [(f"{path}.{name}" if path else str(name), item) for name, item in value.items()]
    else:
        inner = [(f"{path}[{index}]", item) for index, item in enumerate(_items(value) or ())]
        if not inner:
            return {path: value}
    return {place: leaf for name, item in inner for place, leaf in leaves(item, name).items()}


def expected_leaves(expected: Mapping[str, Any], message: Mapping[str, Any]) -> dict[str, Any]:
    """Flatten an expected value by the fields that a message has.

    Raises:
        NoSuchField: A name is not a field of the message, or its value has another kind.
    """
    found: dict[str, Any] = {}
    _expect([], expected, message, "", found)
    return found


def _field_of(message: Any, name: str, here: str) -> Any:
    """The value of a field of a message that is called ``here`` in errors."""
    if not isinstance(message, Mapping):
        raise NoSuchField(f"{here} has no field {name!r}: it is a plain value")
    if name not in message:
        raise NoSuchField(
            f"{here} has no field {name!r}; it has {', '.join(sorted(message)) or 'none'}."
            + did_you_mean(name, message)
        )
    return message[name]


def value_at(message: Mapping[str, Any], path: str) -> Any:
    """The plain value in a field of a message; :class:`NoSuchField` if there is none."""
    here: Any = message
    done = "the message"
    for step in _STEP.findall(path):
        if isinstance(here, Sequence) and not isinstance(here, str) and step.isdigit():
            if int(step) >= len(here):
                raise NoSuchField(f"{done} has {len(here)} items, so there is no [{step}]")
            here = here[int(step)]
        else:
            here = _field_of(here, step, done)
        done = step
    if isinstance(here, Mapping):
        raise NoSuchField(f"{path} is a message: name one of its fields ({', '.join(here)})")
    return here


def number_at(message: Mapping[str, Any], path: str) -> float:
    """The number in a field of a message; :class:`NoSuchField` if there is none."""
    value = value_at(message, path)
    if not isinstance(value, int | float):
        raise NoSuchField(f"{path} is not a number")
    return float(value)


def _expect(names: list[str], item: Any, message: Any, path: str, found: dict[str, Any]) -> None:
    if names:
        inner = _field_of(message, names[0], path or "the message")
        _expect(names[1:], item, inner, f"{path}.{names[0]}" if path else names[0], found)
    elif isinstance(item, Mapping):
        for key, inner in item.items():
            _expect(str(key).split("."), inner, message, path, found)
    elif isinstance(message, Mapping):
        raise NoSuchField(f"{path} is a message: name its fields ({', '.join(message)})")
    elif _kind(item) != _kind(message):
        raise NoSuchField(f"{path} {_other_kind(item, message)}")
    else:
        found[path] = item


def _other_kind(item: Any, value: Any) -> str:
    here, wanted = ("true or false" if isinstance(x, bool) else _kind(x) for x in (value, item))
    words = item.lower() if isinstance(item, str) and isinstance(value, bool) else ""
    advice = ": write true or false" if words in ("yes", "no", "on", "off") else ""
    return f"is {here}, but {wanted} is expected of it{advice}"


def unreachable(expected: Any, sample: Any, tolerance: float) -> str:
    """Why a field can never have an expected value, to follow its name; nothing if it can."""
    if _kind(expected) != _kind(sample):
        return _other_kind(expected, sample)
    items, samples = _items(expected), _items(sample)
    if items is not None and samples:
        return next(filter(None, (unreachable(one, samples[0], tolerance) for one in items)), "")
    if not isinstance(expected, int | float) or not isinstance(sample, int | float):
        return ""
    if isinstance(sample, bool):
        fits, kind = expected in (0, 1), "true or false"
    elif isinstance(sample, int):
        whole = not math.isfinite(expected) or abs(expected - round(expected)) <= tolerance
        fits, kind = whole and not isinstance(expected, bool), "a whole number"
    else:
        fits, kind = not isinstance(expected, bool), "a number"
    shown = str(expected).lower() if isinstance(expected, bool) else expected
    return "" if fits else f"is {kind}, but {shown} is expected of it"


def differences(
    expected: Mapping[str, Any],
    message: Mapping[str, Any],
    *,
    rest_zero: bool,
    tolerance: Tolerance,
) -> tuple[Difference, ...]:
    """Fields of a message that do not have the expected value.

    Args:
        rest_zero: Whether every field that is not expected to be something must be zero,
            false or empty.
        tolerance: Largest absolute difference of two numbers.
    """
    found = []
    for path, wanted in expected.items():
        observed = value_at(message, path)
        if not same(wanted, observed, tolerance_of(tolerance, path)):
            found.append(Difference(path, wanted, observed))
    if rest_zero:
        for path, observed in leaves(message).items():
            named = any(path == known or path.startswith(known + "[") for known in expected)
            if not named and not _is_zero(observed, tolerance_of(tolerance, path)):
                zero = [] if _items(observed) is not None else type(observed)()
                found.append(Difference(path, zero, observed))
    return tuple(found)


def tolerance_of(tolerance: Tolerance, path: str) -> float:
    """The tolerance of one field."""
    return tolerance.get(path, EXACT) if isinstance(tolerance, Mapping) else tolerance


def same(wanted: Any, observed: Any, tolerance: float) -> bool:
    """Whether an observed value is the wanted one; NaN is the same as NaN.

    A float32 field holds the float32 that is nearest to the wanted number: that is the same.
    """
    wanted_items, observed_items = _items(wanted), _items(observed)
    if wanted_items is not None and observed_items is not None:
        return len(wanted_items) == len(observed_items) and all(
            same(a, b, tolerance) for a, b in zip(wanted_items, observed_items, strict=True)
        )
    truth = isinstance(wanted, bool) or isinstance(observed, bool)
    if truth or not (isinstance(wanted, int | float) and isinstance(observed, int | float)):
        # A tolerance is for numbers: false is never near enough to true.
        return bool(wanted == observed)
    if math.isnan(wanted) or math.isnan(observed):
        return math.isnan(wanted) and math.isnan(observed)
    if wanted == observed or abs(wanted - observed) <= tolerance:
        return True
    in_range = abs(wanted) <= FLOAT32_MAX
    return in_range and observed == struct.unpack("f", struct.pack("f", wanted))[0]


def same_value(wanted: Any, observed: Any) -> bool:
    """Whether two values of parameters are the same: ``true`` is not 1."""
    return isinstance(wanted, bool) == isinstance(observed, bool) and same(wanted, observed, EXACT)


def _is_zero(value: Any, tolerance: float) -> bool:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return abs(value) <= tolerance
    return not value


def _items(value: Any) -> Sequence[Any] | None:
    """Items of an array field; None for anything else."""
    if isinstance(value, str) or not isinstance(value, Sequence):
        return None
    return value


def _kind(value: Any) -> str:
    if _items(value) is not None:
        return "a list"
    # A bool counts as a number, for a decoder may give 1 for true.
    if isinstance(value, int | float):
        return "a number"
    if value is None:
        return "nothing"
    return "a text" if isinstance(value, str) else type(value).__name__
