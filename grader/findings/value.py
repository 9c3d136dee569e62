"""Values of the fields of a message, by paths such as ``pose.position.x`` or ``ranges[0]``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Annotated, Any

from pydantic import AfterValidator

from grader.findings import condition
from grader.spec.expression import Expression
from grader.spec.nearest_name import did_you_mean

EXACT = condition.EXACT
"""Largest difference of two numbers that are meant to be the same."""

Tolerance = float | Mapping[str, float]
"""Largest difference of two numbers: of every field, or by path, where others are exact."""

_STEP = re.compile(r"[A-Za-z0-9_]+")


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
    """The assignment names a field that the message does not have, or that has another kind."""


class NoSuchItem(NoSuchField):
    """An array of the message has fewer items than the assignment names."""


def is_list(value: Any) -> bool:
    """Whether a value is an array: a text is none."""
    return isinstance(value, Sequence) and not isinstance(value, str)


def path_below(path: str, name: object) -> str:
    """The path of a field of the message at a path, which is empty for the whole message."""
    return f"{path}.{name}" if path else str(name)


def leaves(value: Any, path: str = "") -> dict[str, Any]:
    """Flatten a message: path of every leaf -> its value. An empty list is a leaf."""
    if isinstance(value, Mapping):
        parts = {path_below(path, name): part for name, part in value.items()}
    elif is_list(value) and value:
        parts = {f"{path}[{index}]": part for index, part in enumerate(value)}
    else:
        return {path: value}
    flat: dict[str, Any] = {}
    for part_path, part in parts.items():
        flat |= leaves(part, part_path)
    return flat


def part_at(message: Any, path: str, message_path: str = "") -> Any:
    """What is at a path in a message: a plain value, a list or a message again.

    Args:
        message_path: Where the message itself is, for errors; empty for a whole message.

    Raises:
        NoSuchField: The message has no such field; :class:`NoSuchItem` if an array is too short.
    """
    part, part_path = message, message_path
    for step in _STEP.findall(path):
        part_name = part_path or "the message"
        if is_list(part) and step.isdigit():
            if int(step) >= len(part):
                raise NoSuchItem(f"{part_name} has {len(part)} items, so there is no [{step}]")
            part, part_path = part[int(step)], f"{part_path}[{step}]"
        elif not isinstance(part, Mapping):
            raise NoSuchField(f"{part_name} has no field {step!r}: it is a plain value")
        elif step not in part:
            fields = ", ".join(sorted(part)) or "none"
            advice = did_you_mean(step, part)
            raise NoSuchField(f"{part_name} has no field {step!r}; it has {fields}.{advice}")
        else:
            part, part_path = part[step], path_below(part_path, step)
    return part


def value_at(message: Mapping[str, Any], path: str) -> Any:
    """The plain value in a field of a message, or of an expression of its fields.

    Raises:
        NoSuchField: There is none.
    """
    try:
        value = Expression.of(path).value(partial(part_at, message))
    except TypeError as error:
        raise NoSuchField(f"{path} cannot be computed: {error}") from None
    if isinstance(value, Mapping):
        raise NoSuchField(f"{path} is a message: name one of its fields ({', '.join(value)})")
    return value


def item_at(message: Mapping[str, Any], path: str) -> Any:
    """The same; None where an array is too short, which is no mistake of the assignment."""
    try:
        return value_at(message, path)
    except NoSuchItem:
        return None


def number_at(message: Mapping[str, Any], path: str) -> float:
    """The number in a field of a message; :class:`NoSuchField` if there is none."""
    value = value_at(message, path)
    if not isinstance(value, int | float):
        raise NoSuchField(f"{path} is not a number")
    return float(value)


def tolerance_of(tolerance: Tolerance, path: str) -> float:
    """The tolerance of one field."""
    return tolerance.get(path, EXACT) if isinstance(tolerance, Mapping) else tolerance
