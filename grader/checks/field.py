"""Paths to a value in a message, such as ``pose.pose.position.x`` or ``ranges[0]``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator

from grader.checks.value import NoSuchField, field_of

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


def value_at(message: Mapping[str, Any], path: str) -> Any:
    """The plain value in a field of a message.

    Raises:
        NoSuchField: The message has no such field, or it holds other fields.
    """
    here: Any = message
    done = "the message"
    for step in _STEP.findall(path):
        if isinstance(here, Sequence) and not isinstance(here, str) and step.isdigit():
            if int(step) >= len(here):
                raise NoSuchField(f"{done} has {len(here)} items, so there is no [{step}]")
            here = here[int(step)]
        else:
            here = field_of(here, step, done)
        done = step
    if isinstance(here, Mapping):
        raise NoSuchField(f"{path} is a message: name one of its fields ({', '.join(here)})")
    return here


def number_at(message: Mapping[str, Any], path: str) -> float:
    """The number in a field of a message.

    Raises:
        NoSuchField: The message has no such field, or it holds no number.
    """
    value = value_at(message, path)
    if not isinstance(value, int | float):
        raise NoSuchField(f"{path} is not a number")
    return float(value)
