"""What an assignment expects of the fields of a message, compared with what they have."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum, auto
from functools import partial
from types import MappingProxyType
from typing import Any

from grader.findings.condition import is_comparison, is_near, meets
from grader.findings.text import check_asked, is_asked_of_text, looks_like_a_condition, says
from grader.findings.value import (
    EXACT,
    NoSuchField,
    NoSuchItem,
    Tolerance,
    is_list,
    item_at,
    leaves,
    part_at,
    path_below,
    tolerance_of,
    value_at,
)
from grader.spec.expression import Expression, is_field

_QUATERNION = "xyzw"


@dataclass(frozen=True)
class Difference:
    """A field, such as ``linear.x`` or ``data[2]``, that does not have the expected value."""

    field: str
    expected: Any
    observed: Any


class _Comparison(Enum):
    """How an expected value is compared with an observed one: the kinds of both decide it."""

    ASKED_OF_TEXT = auto()
    CONDITION = auto()
    FIELD_BY_FIELD = auto()
    ITEM_BY_ITEM = auto()
    NUMBERS = auto()
    EQUALITY = auto()


def _comparison(expected: Any, observed: Any) -> _Comparison:
    if isinstance(observed, str) and is_asked_of_text(expected):
        return _Comparison.ASKED_OF_TEXT
    # `> 0` is a condition only of a number: expected of a text, it is just that text.
    if isinstance(expected, str) and expected != "" and _is_number(observed):
        return _Comparison.CONDITION
    if isinstance(expected, Mapping) and isinstance(observed, Mapping):
        return _Comparison.FIELD_BY_FIELD
    if is_list(expected) and is_list(observed):
        return _Comparison.ITEM_BY_ITEM
    if _is_number(expected) and _is_number(observed):
        return _Comparison.NUMBERS
    # A tolerance is for numbers: false is never near enough to true.
    return _Comparison.EQUALITY


def same(
    expected: Any,
    observed: Any,
    tolerance: float,
    message: Mapping[str, Any] = MappingProxyType({}),
    circle: float = 0.0,
) -> bool:
    """Whether an observed value is the expected one; a text may ask something of a number.

    Args:
        message: With the fields that expressions in the text name.
        circle: Of an angle a full turn in its unit.

    Raises:
        NoSuchField: The text asks nothing of a number, or names what the message does not have.
    """
    same_part = partial(same, tolerance=tolerance, message=message, circle=circle)
    match _comparison(expected, observed):
        case _Comparison.ASKED_OF_TEXT:
            return says(observed, **expected)
        case _Comparison.CONDITION:
            return _meets_condition(expected, observed, tolerance, message, circle)
        case _Comparison.FIELD_BY_FIELD:
            return expected.keys() == observed.keys() and all(
                same_part(part, observed[name]) for name, part in expected.items()
            )
        case _Comparison.ITEM_BY_ITEM:
            return len(expected) == len(observed) and all(map(same_part, expected, observed))
        case _Comparison.NUMBERS:
            return is_near(expected, observed, tolerance, circle)
        case _Comparison.EQUALITY:
            return bool(expected == observed)


def _meets_condition(
    text: str, observed: float, tolerance: float, message: Mapping[str, Any], circle: float
) -> bool:
    try:
        return meets(text, observed, tolerance, partial(part_at, message), circle)
    except NoSuchItem:
        # The student's array is too short for the condition, such as `> ranges[7]`.
        return False
    except NoSuchField as error:
        raise NoSuchField(f"{text!r} is expected of it: {error}") from None
    except (TypeError, ValueError) as error:
        raise NoSuchField(
            f"{text!r} is expected of it: write a number, '> 0', '0.1 .. 0.5' or an "
            f"expression of fields ({error})"
        ) from None


def same_value(expected: Any, observed: Any) -> bool:
    """Whether a parameter has the expected value: ``true`` is not 1, and '1' neither."""
    if _comparison(expected, observed) is _Comparison.CONDITION and not is_comparison(expected):
        return False
    if isinstance(expected, bool) != isinstance(observed, bool):
        return False
    return same(expected, observed, EXACT)


def expected_leaves(expected: Mapping[str, Any], message: Mapping[str, Any]) -> dict[str, Any]:
    """Flatten an expected value by the fields that a message has: path -> expected of it.

    Raises:
        NoSuchField: A name is not a field of the message, or its value has another kind.
    """
    flat = _flattened(expected, message, "")
    for path, item in flat.items():
        try:
            same(item, item_at(message, path), EXACT, message)
        except NoSuchField as error:
            raise NoSuchField(f"{path} is a number, but {error}") from None
    return flat


def _flattened(expected: Mapping[str, Any], message: Any, message_path: str) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, item in expected.items():
        path = path_below(message_path, key)
        try:
            part = _part_of_key(message, str(key), message_path)
        except NoSuchItem:
            # The student's array may be too short: that is a difference, no wrong assignment.
            flat[path] = item
            continue
        if isinstance(item, Mapping) and _comparison(item, part) is not _Comparison.ASKED_OF_TEXT:
            flat |= _flattened(item, part, path)
        else:
            _check_leaf(item, part, path)
            flat[path] = item
    return flat


def _part_of_key(message: Any, key: str, message_path: str) -> Any:
    """What a key of an expected value names in the message that is at a path."""
    try:
        Expression.of(key)
    except ValueError as error:
        name = message_path or "the message"
        raise NoSuchField(f"{name} has no field {key!r}: {error}") from None
    if is_field(key):
        return part_at(message, key, message_path)
    if message_path:
        raise NoSuchField(
            f"write {key!r} outside of {message_path!r}, with the whole paths of fields"
        )
    return value_at(message, key)


def _check_leaf(expected: Any, observed: Any, path: str) -> None:
    """Refuse what can be expected of no field of this kind."""
    comparison = _comparison(expected, observed)
    if comparison is _Comparison.ASKED_OF_TEXT:
        try:
            check_asked(expected)
        except ValueError as error:
            raise NoSuchField(f"{path}: {error}") from None
    elif isinstance(observed, Mapping):
        raise NoSuchField(f"{path} is a message: name its fields ({', '.join(observed)})")
    elif comparison is not _Comparison.CONDITION and _kind(expected) != _kind(observed):
        raise NoSuchField(f"{path} {_other_kind(expected, observed)}")


def unreachable(expected: Any, sample: Any, tolerance: float) -> str:
    """Why a field can never have an expected value, such as ``is true or false, but ...``.

    An empty text if it can.
    """
    comparison = _comparison(expected, sample)
    if comparison is _Comparison.CONDITION or is_asked_of_text(expected):
        return ""
    if isinstance(expected, str) and isinstance(sample, str) and looks_like_a_condition(expected):
        return (
            f"is a text, and {expected!r} would be compared with the whole of it: write "
            "{contains: ...}, {matches: ...} or {number: ...}"
        )
    if _kind(expected) != _kind(sample):
        return _other_kind(expected, sample)
    if comparison is _Comparison.ITEM_BY_ITEM and sample:
        reasons = (unreachable(item, sample[0], tolerance) for item in expected)
        return next(filter(None, reasons), "")
    if isinstance(expected, int | float) and isinstance(sample, int | float):
        return _unreachable_number(expected, sample, tolerance)
    return ""


def _unreachable_number(expected: float, sample: float, tolerance: float) -> str:
    kind = "a number"
    is_reachable = not isinstance(expected, bool)
    if isinstance(sample, bool):
        kind = "true or false"
        is_reachable = expected in (0, 1)
    elif isinstance(sample, int):
        kind = "a whole number"
        if is_reachable and math.isfinite(expected):
            is_reachable = abs(expected - round(expected)) <= tolerance
    if is_reachable:
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
        expected: By path, as :func:`expected_leaves` returns it.
        rest_zero: Whether every field that is not expected to be something must be zero,
            false or empty.
        tolerance: Largest absolute difference of two numbers.
    """
    wrong = []
    for path, item in expected.items():
        observed, circle = item_at(message, path), Expression.of(path).circle
        if same(item, observed, tolerance_of(tolerance, path), message, circle):
            continue
        if not _is_opposite(path, expected, message, tolerance):
            wrong.append(Difference(path, item, observed))
    if rest_zero:
        wrong += _not_zero(expected, message, tolerance)
    return tuple(wrong)


def _is_opposite(
    path: str, expected: Mapping[str, Any], message: Mapping[str, Any], tolerance: Tolerance
) -> bool:
    """Whether a field is of a quaternion that is -q where q is expected: the same rotation."""
    # The quaternion of `pose.orientation.w` is `pose.orientation`; that of `w` the whole message.
    quaternion_path = path[:-2] if path[-2:-1] == "." else ""
    part_paths = [path_below(quaternion_path, part) for part in _QUATERNION]
    if path not in part_paths:
        return False
    if any(_kind(expected.get(part_path)) != "a number" for part_path in part_paths):
        return False
    if set(part_at(message, quaternion_path)) != set(_QUATERNION):
        return False
    return all(
        same(-expected[part_path], value_at(message, part_path), tolerance_of(tolerance, part_path))
        for part_path in part_paths
    )


def _not_zero(
    expected: Mapping[str, Any], message: Mapping[str, Any], tolerance: Tolerance
) -> Iterator[Difference]:
    """Fields that nothing is expected of, and that are not zero, false or empty."""
    expected_paths = {field for path in expected for field in Expression.of(path).fields}
    for path, observed in leaves(message).items():
        is_expected = any(
            path == other or path.startswith((f"{other}[", f"{other}.")) for other in expected_paths
        )
        if not is_expected and not _is_zero(observed, tolerance_of(tolerance, path)):
            zero = [] if is_list(observed) else type(observed)()
            yield Difference(path, zero, observed)


def _is_zero(value: Any, tolerance: float) -> bool:
    if _is_number(value):
        return bool(abs(value) <= tolerance)
    return not value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _other_kind(expected: Any, observed: Any) -> str:
    reason = f"is {_kind_words(observed)}, but {_kind_words(expected)} is expected of it"
    if isinstance(observed, bool) and str(expected).lower() in ("yes", "no", "on", "off"):
        reason += ": write true or false"
    return reason


def _kind_words(value: Any) -> str:
    return "true or false" if isinstance(value, bool) else _kind(value)


def _kind(value: Any) -> str:
    if is_list(value):
        return "a list"
    # A bool counts as a number, for a decoder may give 1 for true.
    if isinstance(value, int | float):
        return "a number"
    if value is None:
        return "nothing"
    return "a text" if isinstance(value, str) else type(value).__name__
