"""Texts of a submission, such as its README: their headings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from grader.submission.intake.listing import SubmissionFile
from grader.submission.intake.paths import shown

_SUFFIXES = (".md", ".rst", ".txt")
_MOST_TEXTS = 50
_MOST_HEADINGS = 200
_MOST_BYTES = 256 * 1024
_HEADING = re.compile(
    r"""^\ {0,3}\#{1,6}[ \t]+(?P<marked>.+?)[ \t]*\#*[ \t]*$          # Markdown
    | ^(?P<underlined>\S.*)\n(?P<line>[=\-~^"'`*+#])(?P=line){2,}[ \t]*$  # and reStructuredText
    """,
    re.MULTILINE | re.VERBOSE,
)
_FENCED = re.compile(r"^(```|~~~).*?^\1", re.MULTILINE | re.DOTALL)


def headings(text: str) -> tuple[str, ...]:
    """The headings of a text in Markdown or reStructuredText, in their order."""
    found = _HEADING.finditer(_FENCED.sub("", text.replace("\r\n", "\n")))
    return tuple(shown(one["marked"] or one["underlined"]).strip() for one in found)


def read_headings(
    root: Path, files: Sequence[SubmissionFile]
) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Path of each text of a submission -> its headings."""
    texts = [
        file
        for file in files
        if file.link is None
        and file.size <= _MOST_BYTES
        and (file.path.lower().endswith(_SUFFIXES) or _is_readme(file.path))
    ]
    return tuple(
        (shown(file.path), headings(_text(root / file.path))[:_MOST_HEADINGS])
        for file in texts[:_MOST_TEXTS]
    )


def _is_readme(path: str) -> bool:
    return path.rpartition("/")[2].lower() == "readme"


def _text(path: Path) -> str:
    return path.read_text("utf-8", "replace")
