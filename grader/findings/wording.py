"""Words that findings are made of: lists, counts and numbers as people read them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

_LISTED = 8
_LONGEST_TEXT = 120


def code(text: str) -> str:
    """Mark a name or a piece of code."""
    return f"`{text}`"


def listing(items: Iterable[str], last: str = "and") -> str:
    """Write ``a, b and c``; of a long list the first few and how many more there are."""
    words = list(dict.fromkeys(items))
    if len(words) > _LISTED:
        words = [*words[:_LISTED], f"{len(words) - _LISTED} more"]
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def codes(items: Iterable[str], last: str = "and") -> str:
    """:func:`listing` of names, each marked as code."""
    return listing((code(item) for item in items), last)


def counted(number: int, noun: str, plural: str | None = None) -> str:
    """Write ``1 message`` or ``12 messages``."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def value_text(value: Any) -> str:
    """Write a value of a message field exactly, so that two different ones never look alike."""
    if value is None:
        text = "nothing"
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, float):
        text = repr(value) if math.isfinite(value) else str(value)
    elif isinstance(value, Sequence) and not isinstance(value, str | bytes | bytearray):
        head = ", ".join(value_text(item) for item in value[:_LISTED])
        text = f"[{head}{', ...' if len(value) > _LISTED else ''}]"
    else:
        text = repr(value)
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}..."


def percent(ratio: float) -> str:
    """Write a ratio as ``5 %``."""
    return f"{ratio * 100.0:.4g} %"
