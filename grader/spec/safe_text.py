"""Text of a student made safe to show: what would act on a screen is shown, never obeyed.

Student code chooses node names, log lines, file names and messages. A terminal obeys escape
sequences, a browser reorders text at bidirectional controls, and an XML reader refuses most
control characters. Escaping for HTML or for rich's markup is left to the renderers.
"""

from __future__ import annotations

import re

_ESCAPES = re.compile(
    r"""
    (?:\x1b\]|\x9d) [^\x07\x1b\x9c\n]* (?:\x07|\x1b\\|\x9c)?    # OSC: titles, hyperlinks
    | (?:\x1b[PX^_]|[\x90\x98\x9e\x9f]) [^\x1b\x9c\n]* (?:\x1b\\|\x9c)?  # DCS, SOS, PM, APC
    | (?:\x1b\[|\x9b) [0-?]* [ -/]* [@-~]                       # CSI: colours, cursor
    | \x1b [ -/]* [0-~]                                         # all others
    """,
    re.VERBOSE,
)
_LINE_ENDS = re.compile(r"\r\n|\x85|\u2028|\u2029")
_UNSAFE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"
    "\u00ad\u061c\u180e\u200b\u200e\u200f\u202a-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff\U000e0000-\U000e0fff]"
)
_SURROGATES = re.compile("[\ud800-\udfff]")


def clean(text: str) -> str:
    r"""Make text safe to show, with its lines and tabs.

    Escape sequences are dropped; other control characters become visible: ``\x00`` is shown as
    ``␀``, invisible and reordering characters as ``<U+202E>``.
    """
    # Most text is plain, and a report holds thousands of pieces of it.
    if text.isascii() and text.isprintable():
        return text
    text = _ESCAPES.sub("", text)
    text = _LINE_ENDS.sub("\n", text)
    return _UNSAFE.sub(_shown, text)


def visible(text: str) -> str:
    """Show each character that acts on a screen by its code point, such as ``<U+001B>``.

    Other than by :func:`clean` nothing is dropped, and lines stay as they are: for source code.
    """
    if text.isascii() and text.isprintable():
        return text
    pattern = f"{_UNSAFE.pattern}|[\u2028\u2029]"
    return re.sub(pattern, lambda found: f"<U+{ord(found[0]):04X}>", text)


def one_line(text: str) -> str:
    """Make text safe to show in one line; line ends become ``⏎``."""
    if text.isascii() and text.isprintable():
        return text if text.strip() else ""
    return " ⏎ ".join(line for line in clean(text).expandtabs(4).split("\n") if line.strip())


def encodable(text: str) -> str:
    """Replace what UTF-8 cannot hold, and leave all else as it is."""
    return _SURROGATES.sub("\N{REPLACEMENT CHARACTER}", text)


def _shown(match: re.Match[str]) -> str:
    code = ord(match[0])
    if code < 0x20:
        return chr(0x2400 + code)
    if code == 0x7F:
        return "␡"
    if 0xD800 <= code <= 0xDFFF:
        return "\N{REPLACEMENT CHARACTER}"
    return f"<U+{code:04X}>"
