"""Values of messages, field by field, against what an assignment expects of them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import AfterValidator

from grader.findings import condition
from grader.findings.condition import is_comparison, is_near, meets
from grader.findings.text import check_asked, is_asked_of_text, looks_like_a_condition, says
from grader.spec.expression import Expression, is_field
from grader.spec.nearest_name import did_you_mean

EXACT = condition.EXACT
"""Largest difference of two numbers that are meant to be the same."""

Tolerance = float | Mapping[str, float]
"""Largest difference of two numbers: of every field, or by path, where others are exact."""

_STEP = re.compile(r"[A-Za-z0-9_]+")
_QUATERNION = "xyzw"


def _field_path(text: str) -> str:
    try:
        Expression.of(text)
    except ValueError as error:
        raise ValueError(
            f"{text!r} is not a field: write its path, such as 'pose.pose.position.x' or "
            f"'ranges[0]', or an expression such as 'yaw(pose.pose.orientation)' ({error})"
        ) from None
    return text


FieldPath = Annotated[str, AfterValidator(_field_path)]
"""The path of a field, or an expression of fields."""


class NoSuchField(ValueError):
    """The expected value names a field that the message does not have, or of another kind."""


class NoSuchItem(NoSuchField):
    """An array of the message has fewer items than the assignment names."""


@dataclass(frozen=True)
class Difference:
    """A field, such as ``linear.x`` or ``data[2]``, that does not have the expected value."""

    field: str
    expected: Any
    observed: Any


def leaves(value: Any, path: str = "") -> dict[str, Any]:
    """Flatten a message: path of every leaf -> its value. An empty list is a leaf."""
    if isinstance(value, Mapping):
        parts = {_below(path, name): part for name, part in value.items()}
    else:
        parts = {f"{path}[{index}]": part for index, part in enumerate(_items(value) or ())}
        if not parts:
            return {path: value}
    found: dict[str, Any] = {}
    for place, part in parts.items():
        found |= leaves(part, place)
    return found


def _below(path: str, name: object) -> str:
    """The path of a field of the message at a path, which is empty for the whole message."""
    return f"{path}.{name}" if path else str(name)


def expected_leaves(expected: Mapping[str, Any], message: Mapping[str, Any]) -> dict[str, Any]:
    """Flatten an expected value by the fields that a message has.

    Raises:
        NoSuchField: A name is not a field of the message, or its value has another kind.
    """
    found: dict[str, Any] = {}
    _expect(expected, message, "", found)
    for path, item in found.items():
        if is_asked_of_text(item):
            continue
        try:
            same(item, item_at(message, path), EXACT, message)
        except NoSuchField as error:
            raise NoSuchField(f"{path} is a number, but {error}") from None
    return found


def _field_of(message: Any, name: str, called: str) -> Any:
    """The value of a field of a message, which errors call as ``called``."""
    if not isinstance(message, Mapping):
        raise NoSuchField(f"{called} has no field {name!r}: it is a plain value")
    if name not in message:
        raise NoSuchField(
            f"{called} has no field {name!r}; it has {', '.join(sorted(message)) or 'none'}."
            + did_you_mean(name, message)
        )
    return message[name]


def value_at(message: Mapping[str, Any], path: str) -> Any:
    """The plain value in a field of a message, or of an expression of its fields.

    Raises:
        NoSuchField: There is none.
    """
    try:
        found = Expression.of(path).value(partial(_part_of, message))
    except TypeError as error:
        raise NoSuchField(f"{path} cannot be computed: {error}") from None
    if isinstance(found, Mapping):
        raise NoSuchField(f"{path} is a message: name one of its fields ({', '.join(found)})")
    return found


def item_at(message: Mapping[str, Any], path: str) -> Any:
    """The same; None where an array is too short, which is no mistake of the assignment."""
    try:
        return value_at(message, path)
    except NoSuchItem:
        return None


def _part_of(message: Any, path: str, around: str = "") -> Any:
    """What is in a field of a message, whose own path is ``around``: perhaps a message itself."""
    part = message
    for step in _STEP.findall(path):
        if isinstance(part, Sequence) and not isinstance(part, str) and step.isdigit():
            if int(step) >= len(part):
                raise NoSuchItem(f"{around} has {len(part)} items, so there is no [{step}]")
            part = part[int(step)]
            around += f"[{step}]"
        else:
            part = _field_of(part, step, around or "the message")
            around = _below(around, step)
    return part


def number_at(message: Mapping[str, Any], path: str) -> float:
    """The number in a field of a message; :class:`NoSuchField` if there is none."""
    value = value_at(message, path)
    if not isinstance(value, int | float):
        raise NoSuchField(f"{path} is not a number")
    return float(value)


def _expect(item: Any, message: Any, path: str, found: dict[str, Any]) -> None:
    if isinstance(message, str) and is_asked_of_text(item):
        try:
            check_asked(item)
        except ValueError as error:
            raise NoSuchField(f"{path}: {error}") from None
        found[path] = item
    elif isinstance(item, Mapping):
        for name, inner in item.items():
            inner_path = _below(path, name)
            try:
                _expect(inner, _named(message, str(name), path), inner_path, found)
            except NoSuchItem:
                found[inner_path] = inner
    elif isinstance(message, Mapping):
        raise NoSuchField(f"{path} is a message: name its fields ({', '.join(message)})")
    elif not _is_condition(item, message) and _kind(item) != _kind(message):
        raise NoSuchField(f"{path} {_other_kind(item, message)}")
    else:
        found[path] = item


def _named(message: Any, key: str, around: str) -> Any:
    """What a key of an expected value names, in the message that is at the path ``around``."""
    try:
        Expression.of(key)
    except ValueError as error:
        raise NoSuchField(f"{around or 'the message'} has no field {key!r}: {error}") from None
    if is_field(key):
        return _part_of(message, key, around)
    if around:
        raise NoSuchField(f"write {key!r} outside of {around!r}, with the whole paths of fields")
    return value_at(message, key)


def _is_condition(expected: Any, value: Any) -> bool:
    """Whether a text is expected of a number: it is a condition, such as ``> 0``."""
    return isinstance(expected, str) and expected != "" and _is_number(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _other_kind(expected: Any, value: Any) -> str:
    found, wanted = (
        "true or false" if isinstance(one, bool) else _kind(one) for one in (value, expected)
    )
    words = f"is {found}, but {wanted} is expected of it"
    if isinstance(value, bool) and str(expected).lower() in ("yes", "no", "on", "off"):
        words += ": write true or false"
    return words


def unreachable(expected: Any, sample: Any, tolerance: float) -> str:
    """Why a field can never have an expected value, such as ``is true or false, but ...``.

    An empty text if it can.
    """
    if _is_condition(expected, sample) or is_asked_of_text(expected):
        return ""
    if isinstance(expected, str) and isinstance(sample, str) and looks_like_a_condition(expected):
        return (
            f"is a text, and {expected!r} would be compared with the whole of it: write "
            "{contains: ...}, {matches: ...} or {number: ...}"
        )
    if _kind(expected) != _kind(sample):
        return _other_kind(expected, sample)
    expected_items, sample_items = _items(expected), _items(sample)
    if expected_items is not None and sample_items:
        reasons = (unreachable(item, sample_items[0], tolerance) for item in expected_items)
        return next(filter(None, reasons), "")
    if isinstance(expected, int | float) and isinstance(sample, int | float):
        return _unreachable_number(expected, sample, tolerance)
    return ""


def _unreachable_number(expected: float, sample: float, tolerance: float) -> str:
    if isinstance(sample, bool):
        fits, kind = expected in (0, 1), "true or false"
    elif isinstance(expected, bool):
        fits, kind = False, "a whole number" if isinstance(sample, int) else "a number"
    elif isinstance(sample, int) and math.isfinite(expected):
        fits, kind = abs(expected - round(expected)) <= tolerance, "a whole number"
    else:
        return ""
    if fits:
        return ""
    written = str(expected).lower() if isinstance(expected, bool) else expected
    return f"is {kind}, but {written} is expected of it"


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
        observed, circle = item_at(message, path), Expression.of(path).circle
        if not same(wanted, observed, tolerance_of(tolerance, path), message, circle):
            found.append(Difference(path, wanted, observed))
    found = [one for one in found if not _is_opposite(one.field, expected, message, tolerance)]
    if rest_zero:
        found += _not_zero(expected, message, tolerance)
    return tuple(found)


def _not_zero(
    expected: Mapping[str, Any], message: Mapping[str, Any], tolerance: Tolerance
) -> Iterator[Difference]:
    """Fields that nothing is expected of, and that are not zero, false or empty."""
    known = {name for path in expected for name in Expression.of(path).fields}
    for path, observed in leaves(message).items():
        is_known = any(path == name or path.startswith((f"{name}[", f"{name}.")) for name in known)
        if not is_known and not _is_zero(observed, tolerance_of(tolerance, path)):
            zero = [] if _items(observed) is not None else type(observed)()
            yield Difference(path, zero, observed)


def _is_opposite(
    path: str, expected: Mapping[str, Any], message: Mapping[str, Any], tolerance: Tolerance
) -> bool:
    """Whether a field is of a quaternion that is -q where q is expected: the same rotation."""
    # The quaternion of `pose.orientation.w` is `pose.orientation`; that of `w` the whole message.
    around = path[:-2] if path[-2:-1] == "." else ""
    names = [_below(around, part) for part in _QUATERNION]
    if path not in names or any(_kind(expected.get(name)) != "a number" for name in names):
        return False
    if set(_part_of(message, around)) != set(_QUATERNION):
        return False
    return all(
        same(-expected[name], value_at(message, name), tolerance_of(tolerance, name))
        for name in names
    )


def tolerance_of(tolerance: Tolerance, path: str) -> float:
    """The tolerance of one field."""
    return tolerance.get(path, EXACT) if isinstance(tolerance, Mapping) else tolerance


def same(
    wanted: Any,
    observed: Any,
    tolerance: float,
    message: Mapping[str, Any] = MappingProxyType({}),
    circle: float = 0.0,
) -> bool:
    """Whether an observed value is the wanted one; a text may ask something of a number.

    Args:
        message: With the fields that expressions in the text name.
        circle: Of an angle a full turn in its unit.

    Raises:
        NoSuchField: The text asks nothing of a number, or names what the message does not have.
    """
    if isinstance(observed, str) and is_asked_of_text(wanted):
        return says(observed, **wanted)
    if isinstance(wanted, Mapping) and isinstance(observed, Mapping):
        return wanted.keys() == observed.keys() and all(
            same(item, observed[name], tolerance, message) for name, item in wanted.items()
        )
    wanted_items, observed_items = _items(wanted), _items(observed)
    if wanted_items is not None and observed_items is not None:
        return len(wanted_items) == len(observed_items) and all(
            same(*pair, tolerance, message)
            for pair in zip(wanted_items, observed_items, strict=True)
        )
    if _is_condition(wanted, observed):
        try:
            find = partial(_part_of, message)
            return meets(wanted, observed, tolerance, find, circle)
        except NoSuchItem:
            return False
        except NoSuchField as error:
            raise NoSuchField(f"{wanted!r} is expected of it: {error}") from None
        except (TypeError, ValueError) as error:
            raise NoSuchField(
                f"{wanted!r} is expected of it: write a number, '> 0', '0.1 .. 0.5' or an "
                f"expression of fields ({error})"
            ) from None
    if _is_number(wanted) and _is_number(observed):
        return is_near(wanted, observed, tolerance, circle)
    # A tolerance is for numbers: false is never near enough to true.
    return bool(wanted == observed)


def same_value(wanted: Any, observed: Any) -> bool:
    """Whether a parameter has the wanted value: ``true`` is not 1, and '1' neither."""
    if _is_condition(wanted, observed) and not is_comparison(wanted):
        return False
    return isinstance(wanted, bool) == isinstance(observed, bool) and same(wanted, observed, EXACT)


def _is_zero(value: Any, tolerance: float) -> bool:
    if _is_number(value):
        return bool(abs(value) <= tolerance)
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
