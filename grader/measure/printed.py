"""Numbers in lines of output, in whatever way a program formats them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from itertools import combinations

from grader.checks.wording import code

_NUMBER = re.compile(
    r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[-+]?\b(?:inf|nan)\b",
    re.IGNORECASE,
)
# `1,37` as some locales write it. In `(1,37)` it could be two numbers as well: both are tried.
_DECIMAL_COMMA = re.compile(r"(?<![0-9.,])[-+]?[0-9]+,[0-9]+(?![0-9.,])")
# `123,456` and `123_456`, as the format specifications `,` and `_` write it; `123 456` and
# `123'456`, as SI and some locales do. `123 456` could be two numbers as well: both are tried.
_GROUPED = re.compile(
    r"(?<![0-9.,_])[-+]?[0-9]{1,3}([,_'\N{RIGHT SINGLE QUOTATION MARK} \N{NO-BREAK SPACE}"
    r"\N{THIN SPACE}\N{NARROW NO-BREAK SPACE}])[0-9]{3}(?:\1[0-9]{3})*(?:\.[0-9]+)?"
    r"(?![0-9_]|[.,][0-9])"
)
# Typographers' sign, which some locales and tables write.
_MINUS = "\N{MINUS SIGN}"
# `{position.x:.2f}` as it stands in the source.
_UNFILLED = re.compile(r"\{[A-Za-z_][^{}\s\"',]*\}")
# `x = 1.37`, `y: -0.62`, `"x": 1.37`: a name and its number with nothing but such signs between.
_NAMED = re.compile(
    r"""(?<![A-Za-z0-9_])(?P<name>[A-Za-z_]\w*)["']?[ \t]*[:=][ \t]*(?P<number>"""
    + _NUMBER.pattern
    + ")",
    re.IGNORECASE,
)
# What rclpy's loggers put before a text: `[INFO] [1700000000.123456789] [bot]: `.
_LOG_PREFIX = re.compile(r"\s*\[[A-Z]+\] \[[0-9.]+\] \[[^\]]*\]: ?")
# A float32 and its decimal text differ by less.
_FLOAT_NOISE = 1e-6
_LONGEST_QUOTE = 80


def logged_text(line: str) -> str:
    """A line without what a ROS logger puts before it."""
    return _LOG_PREFIX.sub("", line, count=1)


def quote(line: str) -> str:
    """A line for a finding: without its prefix, marked as code, shortened."""
    text = logged_text(line).strip()
    return code(text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}...")


def numbers(line: str) -> tuple[float, ...]:
    """Every number that a line may be read to show, in the order of the text.

    Args:
        line: Any text; the prefix of a ROS logger is left out.
    """
    text = logged_text(line).replace(_MINUS, "-")
    found: list[float] = []
    for match in _NUMBER.finditer(text):
        number = float(match[0])
        found.append(number)
        # In `front-1.37` the sign is a dash.
        if match[0].startswith("-") and text[: match.start()][-1:].isalnum():
            found.append(-number)
    found += [float(match[0].replace(",", ".")) for match in _DECIMAL_COMMA.finditer(text)]
    found += [float(match[0].replace(match[1], "")) for match in _GROUPED.finditer(text)]
    return tuple(found)


def unfilled(line: str) -> str | None:
    """What stands in braces in a line where a value should: the text of an f-string without its f.

    Args:
        line: Any text; `{"x": 1.0}` and `{1.0}` are no such braces.
    """
    found = _UNFILLED.search(logged_text(line))
    return found[0] if found else None


def exchanged(text: str, values: Mapping[str, float], decimals: int) -> tuple[str, str] | None:
    """Two fields each of whose names stands before the other one's value, as in `x = <y>, y = <x>`.

    Names may also follow their numbers or stand apart from them, and such a text is not read.

    Args:
        decimals: How many decimals must be right.

    Returns:
        The two paths, or None.
    """
    named: dict[str, list[float]] = {}
    for match in _NAMED.finditer(logged_text(text).replace(_MINUS, "-")):
        named.setdefault(match["name"].lower(), []).append(float(match["number"]))

    def is_named(path: str, value: float) -> bool:
        return any(shows(number, value, decimals) for number in named.get(_last(path), []))

    for one, other in combinations(values, 2):
        right = is_named(one, values[one]) or is_named(other, values[other])
        wrong = is_named(one, values[other]) and is_named(other, values[one])
        if _last(one) != _last(other) and wrong and not right:
            return one, other
    return None


def _last(path: str) -> str:
    return path.rpartition(".")[2].lower()


def shows(number: float, value: float, decimals: int) -> bool:
    """Whether a printed number stands for a value.

    Args:
        decimals: How many of its decimals must be right; the last of them may be one off,
            because cutting off is right too.
    """
    if not (math.isfinite(number) and math.isfinite(value)):
        return number == value or (math.isnan(number) and math.isnan(value))
    return abs(number - value) <= 10.0**-decimals + _FLOAT_NOISE
