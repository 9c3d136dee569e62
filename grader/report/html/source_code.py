"""Source code as lines for a page, in colours, with nothing in it that could act on a browser."""

from __future__ import annotations

import re
from pathlib import PurePosixPath

from markupsafe import Markup, escape

from grader.safe_text import visible

LONGEST_LINE = 2_000
"""Characters of a line that are shown."""
# The grammars of what students write; others, some of which take long, are never tried.
_GRAMMARS = {
    ".py": "python",
    ".c": "cpp",
    ".cc": "cpp",
    ".cpp": "cpp",
    ".cxx": "cpp",
    ".h": "cpp",
    ".hpp": "cpp",
    ".xml": "xml",
    ".xacro": "xml",
    ".urdf": "xml",
    ".yaml": "yaml",
    ".yml": "yaml",
    ".cfg": "ini",
    ".toml": "toml",
    ".cmake": "cmake",
    ".sh": "bash",
}
_CODE_POINT = re.compile(r"&lt;(U\+[0-9A-F]{4,5})&gt;")


def code_lines(path: str, text: str) -> list[Markup]:
    """The lines of a file as HTML; the first is line 1 of the file.

    Characters that are invisible or reorder text are shown by their code point, and of a huge line
    its beginning.
    """
    from pygments import lex
    from pygments.lexers import get_lexer_by_name

    file = PurePosixPath(path)
    name = "cmake" if file.name == "CMakeLists.txt" else _GRAMMARS.get(file.suffix.lower(), "text")
    lexer = get_lexer_by_name(name, stripnl=False, ensurenl=False)
    shown = "\n".join(map(_bounded, visible(text).split("\n")))
    lines = [Markup("")]
    for kind, value in lex(shown if shown.endswith("\n") else f"{shown}\n", lexer):
        color = _color(kind)
        for number, part in enumerate(value.split("\n")):
            if number:
                lines.append(Markup(""))
            html = Markup(_CODE_POINT.sub(r"<mark>\1</mark>", str(escape(part))))
            lines[-1] += Markup('<span class="{}">{}</span>').format(color, html) if color else html
    return lines[:-1]


def _bounded(line: str) -> str:
    left = len(line) - LONGEST_LINE
    return line if left <= 0 else f"{line[:LONGEST_LINE]} … {left} more characters"


def _color(kind: object) -> str:
    """The class of a token: comment, string, keyword, number, or the name of what is defined."""
    from pygments.token import STANDARD_TYPES, Token

    short = STANDARD_TYPES.get(kind, "")
    if kind in (Token.Name.Function, Token.Name.Class, Token.Name.Tag, Token.Name.Decorator):
        return "f"
    return {"c": "c", "s": "s", "k": "k", "m": "m"}.get(short[:1], "")
