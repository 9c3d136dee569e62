"""The lines of a student's file around a place that a finding names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import NamedTuple

from grader.recording.submission import SourceError
from grader.report.model.result_model import FindingPart

CONTEXT = 3
"""Lines shown before and after the one that is meant."""
_NAME = re.compile(r"\w+[_./-][\w./-]+")
# Where a file says what is usually wrong in it; for places that name only the file.
_ANCHORS = {
    "setup.py": ("console_scripts", "entry_points", "setup("),
    "package.xml": ("<build_type", "<export", "<depend", "<name"),
    "CMakeLists.txt": ("rosidl_generate_interfaces", "ament_package", "project("),
}


class Excerpt(NamedTuple):
    """Lines of a file from ``first`` on, counted from 1, without the ``indent`` that all have."""

    line: int
    first: int
    texts: list[str]
    indent: int


def places(finding: FindingPart) -> tuple[SourceError, ...]:
    """Places of a finding; of one that names none, where what it is about is created."""
    return finding.evidence.places or finding.evidence.origins


def excerpt(place: SourceError, source: Mapping[str, str]) -> Excerpt | None:
    """The lines around a place; None where the file, or the line in it, is not known."""
    lines = source.get(place.file, "").split("\n")
    line = place.line or _line_of(place, lines)
    if not 1 <= line <= len(lines):
        return None
    first = max(1, line - CONTEXT)
    texts = lines[first - 1 : line + CONTEXT]
    indent = min((len(text) - len(text.lstrip(" ")) for text in texts if text.strip()), default=0)
    return Excerpt(line, first, [text[indent:] for text in texts], indent)


def _line_of(place: SourceError, lines: list[str]) -> int:
    """The first line with a name in the message, or with what such messages are about; or 0."""
    anchors = _ANCHORS.get(PurePosixPath(place.file).name, ())
    names = _NAME.findall(place.message) if anchors else ()
    found = (n for text in (*names, *anchors) for n, line in enumerate(lines, 1) if text in line)
    return next(found, 0)
