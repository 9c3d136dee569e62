"""Source code as lines for a page, in colours, with nothing in it that could act on a browser."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path, PurePosixPath
from urllib.parse import quote

from markupsafe import Markup, escape

from grader.recording.submission import SourceError
from grader.report.model.excerpt import excerpt
from grader.spec.safe_text import visible

LONGEST_LINE = 2_000
"""Characters of a line that are shown."""
MOST_S = 1.0
"""CPU time for colours; what is left of the file after it is shown without. Grammars are patterns,
and a text of nothing but blanks takes some of them minutes."""
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

    file, done, end_s = PurePosixPath(path), 0, time.thread_time() + MOST_S
    defined = (Token.Name.Function, Token.Name.Class, Token.Name.Tag, Token.Name.Decorator)
    for grammar, endings in _GRAMMARS.items():
        if file.suffix.lower() in endings or file.name in endings:
            for kind, piece in lex(text, get_lexer_by_name(grammar, stripnl=False)):
                color = "f" if kind in defined else STANDARD_TYPES.get(kind, "")[:1]
                yield color if color in "cfkms" else "", piece
                done += len(piece)
                if time.thread_time() > end_s:
                    break
    yield "", text[done:]


class ShownSource:
    """What a report shows of the source.

    Args:
        files: Texts by path in the submission.
        root: The submission's folder on the reader's own machine, for links that open an editor;
            None in a report for others.
    """

    def __init__(self, files: Mapping[str, str], root: Path | None) -> None:
        self._files, self._root = files, root
        self._shown: dict[tuple[str, int, bool], str] = {}
        self._lines = cache(lambda path: code_lines(path, files[path]))

    def show(
        self, place: SourceError, name: str, *, folded: bool = False
    ) -> tuple[str, list[tuple[int, Markup, bool]]]:
        """The lines around a place, or none but the id of those that show it already.

        Each with its number, and whether it is the one that is meant.
        """
        found = excerpt(place, self._files)
        if found is None:
            return "", []
        key = (place.file, found.line)
        known = self._shown.get((*key, False)) or self._shown.setdefault((*key, folded), name)
        if known != name:
            return known, []
        indent = re.compile(rf"^((?:<span [^>]*>)?) {{{found.indent}}}")
        code = self._lines(place.file)[found.first - 1 :][: len(found.texts)]
        return name, [
            # As plain text: else the first tag of a line would be escaped again.
            (number, Markup(indent.sub(r"\1", str(line))), number == found.line)
            for number, line in enumerate(code, start=found.first)
        ]

    def editor(self, place: SourceError) -> str:
        """The address that opens a place in Visual Studio Code, or nothing."""
        found = excerpt(place, self._files)
        if self._root is None or found is None:
            return ""
        # What was handed in may lie in one more folder.
        files = (folder / place.file for folder in (self._root, *self._root.iterdir()))
        file = next((one for one in files if one.is_file()), None)
        return f"vscode://file{quote(str(file))}:{found.line}" if file else ""
