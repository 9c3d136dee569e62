"""Source code as lines for a page, in colours, with nothing in it that could act on a browser."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import PurePosixPath

from markupsafe import Markup, escape

from grader.spec.safe_text import visible

LONGEST_LINE = 2_000
"""Characters of a line that are shown."""
MOST_S = 1.0
"""Time for colours; what is left of the file after it is shown without. Grammars are patterns, and
a text of nothing but blanks takes some of them minutes."""
_GRAMMARS = {
    "python": (".py",),
    "cpp": (".c", ".cc", ".cpp", ".cxx", ".h", ".hpp"),
    "xml": (".xml", ".xacro", ".urdf"),
    "yaml": (".yaml", ".yml"),
    "ini": (".cfg",),
    "toml": (".toml",),
    "cmake": (".cmake", "CMakeLists.txt"),
    "bash": (".sh",),
}
_CODE_POINT = re.compile(r"&lt;(U\+[0-9A-F]{4,5})&gt;")


def code_lines(path: str, text: str) -> list[Markup]:
    """The lines of a file as HTML; the first is line 1 of the file.

    Characters that are invisible or reorder text are shown by their code point, and of a huge line
    its beginning.
    """
    shown = "\n".join(map(_bounded, visible(text).split("\n")))
    lines = [""]
    for color, piece in _pieces(path, shown if shown.endswith("\n") else f"{shown}\n"):
        for number, part in enumerate(piece.split("\n")):
            if number:
                lines.append("")
            html = _CODE_POINT.sub(r"<mark>\1</mark>", str(escape(part)))
            lines[-1] += f'<span class="{color}">{html}</span>' if color and html else html
    return list(map(Markup, lines[:-1]))


def _bounded(line: str) -> str:
    left = len(line) - LONGEST_LINE
    return line if left <= 0 else f"{line[:LONGEST_LINE]} … {left} more characters"


def _pieces(path: str, text: str) -> Iterator[tuple[str, str]]:
    """The text in pieces, each with its class: comment, string, keyword, number, definition."""
    from pygments import lex
    from pygments.lexers import get_lexer_by_name
    from pygments.token import STANDARD_TYPES, Token

    file, done, end_s = PurePosixPath(path), 0, time.monotonic() + MOST_S
    defined = (Token.Name.Function, Token.Name.Class, Token.Name.Tag, Token.Name.Decorator)
    for grammar, endings in _GRAMMARS.items():
        if file.suffix.lower() in endings or file.name in endings:
            for kind, piece in lex(text, get_lexer_by_name(grammar, stripnl=False)):
                color = "f" if kind in defined else STANDARD_TYPES.get(kind, "")[:1]
                yield color if color in "cfkms" else "", piece
                done += len(piece)
                if time.monotonic() > end_s:
                    break
    yield "", text[done:]
