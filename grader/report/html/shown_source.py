"""The student's source beside the findings of a report: the lines around each place, once."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from urllib.parse import quote

from markupsafe import Markup

from grader.recording.submission import SourceError
from grader.report.html.source_code import code_lines
from grader.report.model.excerpt import excerpt


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
