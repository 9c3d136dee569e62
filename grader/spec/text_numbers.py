"""Numbers in a text, however a program formats them."""

from __future__ import annotations

import re

NUMBER = re.compile(
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
MINUS = "\N{MINUS SIGN}"


def numbers_in(text: str) -> tuple[float, ...]:
    """Every number that a text may be read to show."""
    text = text.replace(MINUS, "-")
    found: list[float] = []
    for match in NUMBER.finditer(text):
        number = float(match[0])
        found.append(number)
        # In `front-1.37` the sign is a dash.
        if match[0].startswith("-") and text[: match.start()][-1:].isalnum():
            found.append(-number)
    found += [float(match[0].replace(",", ".")) for match in _DECIMAL_COMMA.finditer(text)]
    found += [float(match[0].replace(match[1], "")) for match in _GROUPED.finditer(text)]
    return tuple(found)
