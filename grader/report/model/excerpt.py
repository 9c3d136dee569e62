"""What a report shows of long texts: lines of a student's file, and what processes printed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from typing import NamedTuple

from grader.recording.model import LogLine, Recording
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
    if place.file not in source:
        return None
    lines = source[place.file].split("\n")
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
    if not anchors:
        return 0
    for text in (*_NAME.findall(place.message), *anchors):
        for number, line in enumerate(lines, start=1):
            if text in line:
                return number
    return 0


KEPT_LINES = 150
"""Lines of output shown from the beginning, and again from the end."""
KEPT_CHARACTERS = 2000
"""Characters shown of a line."""


@dataclass(frozen=True)
class Output:
    """What the processes printed; ``left_out`` lines are missing between head and tail."""

    head: tuple[LogLine, ...]
    tail: tuple[LogLine, ...]
    left_out: int
    dropped_bytes: int


def printed(recording: Recording) -> tuple[LogLine, ...]:
    """Lines that the processes wrote; /rosout only where there are none.

    rclpy writes each log message to stderr and to /rosout: shown together, all would be twice.
    """
    written = tuple(entry for entry in recording.log if entry.stream != "rosout")
    return written or recording.log


def shorten(recording: Recording) -> Output:
    """The output of a run, without its middle where it is long."""
    lines = tuple(replace(entry, text=_cut(entry.text)) for entry in printed(recording))
    dropped = sum(process.dropped_bytes for process in recording.processes)
    tail = lines[KEPT_LINES:][-KEPT_LINES:]
    return Output(lines[:KEPT_LINES], tail, max(0, len(lines) - 2 * KEPT_LINES), dropped)


def _cut(text: str) -> str:
    excess = len(text) - KEPT_CHARACTERS
    return f"{text[:KEPT_CHARACTERS]}… ({excess:,} more characters)" if excess > 0 else text
