"""What an assignment asks of a text: what it contains or matches, or a number in it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from grader.findings.condition import EXACT, is_comparison, is_near, meets
from grader.findings.words import code
from grader.spec.text_numbers import numbers_in

_WORDS = {
    "contains": lambda asked: f"contains “{asked}”",
    "matches": lambda asked: f"matches {code(asked)}",
    "number": lambda asked: f"has a number {asked}",
}


def is_asked_of_text(wanted: Any) -> bool:
    """Whether an expected value is such a condition, as ``{contains: hello}``."""
    return isinstance(wanted, Mapping) and bool(wanted) and wanted.keys() <= _WORDS.keys()


def says(
    text: str,
    contains: str | None = None,
    matches: str | None = None,
    number: str | float | None = None,
) -> bool:
    """Whether a text is as it is asked for; upper and lower case do not matter in ``contains``.

    Raises:
        ValueError: What it must match is no regular expression, or the number asks nothing.
    """
    if contains is not None and str(contains).casefold() not in text.casefold():
        return False
    if number is not None and not any([_is_as_asked(number, one) for one in numbers_in(text)]):
        return False
    try:
        return matches is None or re.search(str(matches), text) is not None
    except re.error as error:
        raise ValueError(f"{matches!r} is not a regular expression: {error}") from None


def check_asked(asked: Mapping[str, Any]) -> None:
    """Raise a ValueError where :func:`says` could not judge by it."""
    says("0", **{**asked, "contains": ""})


def text_words(asked: Mapping[str, Any]) -> str:
    """A condition in words, such as ``contains “hello” and has a number > 3``."""
    return " and ".join(_WORDS[key](item) for key, item in asked.items())


def looks_like_a_condition(text: str) -> bool:
    """Whether a text that is compared whole looks as if something was asked of a number."""
    return is_comparison(text) and not re.match(r"[A-Za-z]", text.strip())


def _is_as_asked(asked: str | float, number: float) -> bool:
    if not isinstance(asked, str):
        return is_near(asked, number, EXACT)
    try:
        return meets(asked, number, EXACT, _no_field)
    except (TypeError, ValueError):
        text = f"{asked!r} asks nothing of a number: write 1.5, '> 0' or '0.1 .. 0.5'"
        raise ValueError(text) from None


def _no_field(path: str) -> float:
    raise ValueError(f"there is no field {path!r} in a text")
