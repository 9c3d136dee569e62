"""What the C++ of a submission says: the same facts as of its Python.

The parser is tree-sitter, which is C and reads bytes of a student's: it runs as a
:class:`~grader.submission.read.reader.Reader`, each file in a process of its own. What it cannot
read is a fact as well, so that no check takes it for something that the student left out.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from itertools import islice, zip_longest
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter, ValidationError

from grader.errors import GraderFault
from grader.machine.ros import RosInstallation
from grader.recording.submission import CPP, SourceError, SourceFile
from grader.submission.build.bounded import OutputLimits
from grader.submission.intake.locate import Located
from grader.submission.intake.paths import shown
from grader.submission.read.includes import CODE
from grader.submission.read.reader import Reader

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

MAX_BYTES = 512 * 1024
MOST_FILES = 300
"""Larger files, and more of them, are not read."""
_FILE_S, _TOTAL_S = 3, 20
_WALL_S = 60.0
_MIB = 2**20
_READER = Reader(
    "cpp_contents.py",
    ("tree-sitter", "tree-sitter-cpp"),
    _WALL_S,
    OutputLimits(head=32 * _MIB, tail=0, total=32 * _MIB),
)
_FILE = TypeAdapter(SourceFile)
_NOT_READ = "not read: the submission holds too much C++"


def read_cpp(
    located: Located, ros: RosInstallation, sandbox: Sandbox | None
) -> dict[str, SourceFile]:
    """Read every file of C and C++ of a submission, small ones first: path -> its facts."""
    files = sorted(
        (file for file in located.files if file.path.endswith(CODE)), key=lambda one: one.size
    )
    read = [one.path for one in islice(files, MOST_FILES) if one.size <= MAX_BYTES]
    if not files:
        return {}
    why, lines = _NOT_READ, []
    if read:
        given = json.dumps([str(located.root / path) for path in read])
        limits = (str(_FILE_S), str(_TOTAL_S))
        try:
            outcome, _ = _READER.run(located.root, ("given", *limits), ros, sandbox, given)
            lines = outcome.output.split("\n")[:-1]
        except GraderFault as fault:
            # Only what needs it is not judged then.
            why = f"not read: {fault}"
    found = {file.path: unread(file.path, why) for file in files}
    large = f"larger than {MAX_BYTES // 1024} KiB; not read as C++"
    found.update((one.path, unread(one.path, large)) for one in files if one.size > MAX_BYTES)
    found.update(_outlines(read, lines))
    return found


def unread(path: str, why: str, line: int | None = None) -> SourceFile:
    """A file of C++ that was not read."""
    problem = SourceError(shown(path), line, why)
    return SourceFile(shown(path), "", language=CPP, unread=problem)


def source_file(path: str, facts: dict[str, Any]) -> SourceFile:
    """The facts of a file as the program that reads it prints them.

    Raises:
        ValidationError: They are none.
    """
    problem = facts.pop("unread", None)
    line, why = problem or (None, "")
    kept = SourceError(shown(path), line, why) if problem else None
    facts |= {"path": shown(path), "module": "", "language": CPP, "unread": kept}
    return _FILE.validate_python(facts)


def _outlines(paths: Iterable[str], lines: Iterable[str]) -> Iterator[tuple[str, SourceFile]]:
    for path, line in zip_longest(paths, lines):
        if path is None or line is None:
            return
        try:
            yield path, source_file(path, json.loads(line))
        except (ValueError, TypeError, AttributeError, ValidationError):
            yield path, unread(path, "its C++ could not be read")
