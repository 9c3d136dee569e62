"""Every error that rosgrade raises on purpose, one branch per person who can correct it.

RosgradeError
├── UsageError            the caller: wrong argument, missing file
├── AssignmentError       the author of an assignment: bad YAML, with file and line
├── SubmissionError       the student: what was handed in cannot be read
└── GraderFault           rosgrade or the machine: never costs a student a point

A bug is none of these: it keeps its traceback.
"""

from __future__ import annotations

import errno
from dataclasses import dataclass
from pathlib import Path

_ROOM = "make room there, or name another place (for the cache: XDG_CACHE_HOME), and grade again"
_OF_MACHINE = {
    errno.ENOSPC: ("the disk is full", _ROOM),
    errno.EDQUOT: ("your disk quota is used up", _ROOM),
    errno.EFBIG: ("no file may be so large", "raise `ulimit -f` in the shell that grades"),
    errno.EMFILE: ("too many files are open", "raise `ulimit -n` in the shell that grades"),
    errno.ENFILE: ("too many files are open", "raise the sysctl fs.file-max"),
    errno.ENOMEM: ("memory ran out", "grade fewer at once (--jobs)"),
    errno.EROFS: ("the file system is read-only", "name another place"),
    errno.EIO: ("the disk cannot be read or written", "look at the system's log"),
}
"""System errors for which the machine is the reason: in words, and what to do about them."""
_NO_TEMPORARY = (
    "no folder for temporary files can be written to",
    "make room in /tmp, or set TMPDIR to a folder with room",
)


class RosgradeError(Exception):
    """Base of all errors that are shown as one message, without a traceback."""


class UsageError(RosgradeError):
    """The command was used wrongly: an unknown name, a file that does not exist."""


@dataclass(frozen=True)
class Problem:
    """One mistake in a file.

    Attributes:
        line: Line in the file, counted from 1, or None where no line can be named.
        where: The place in the document, such as ``checks[2].points``.
    """

    message: str
    line: int | None = None
    where: str = ""


class AssignmentError(RosgradeError):
    """An assignment, world or mutant file has mistakes."""

    def __init__(self, file: Path, problems: list[Problem]) -> None:
        """Keep the problems as data and make the text from them.

        Args:
            problems: At least one problem.
        """
        self.file = file
        self.problems = tuple(problems)
        lines = []
        for problem in self.problems:
            place = f"{file}:{problem.line}" if problem.line else f"{file}"
            where = f"{problem.where}: " if problem.where else ""
            lines.append(f"{place}: {where}{problem.message}")
        super().__init__("\n".join(lines))


class SubmissionError(RosgradeError):
    """What was handed in cannot be read as a submission; the student can correct it."""


class GraderFault(RosgradeError):
    """rosgrade or the machine failed; the submission is not graded."""


def machine_fault(error: OSError, place: Path | None = None) -> GraderFault | None:
    """The fault for an error of which the machine is the reason; None for any other error.

    Args:
        place: What was written, where the error does not name it.
    """
    # As tempfile.gettempdir() says it.
    no_temporary = "No usable temporary directory" in (error.strerror or "")
    found = _NO_TEMPORARY if no_temporary else _OF_MACHINE.get(error.errno or 0)
    if found is None:
        return None
    what, remedy = found
    named = error.filename2 or error.filename or place
    where = f" ({named})" if named else ""
    return GraderFault(f"this machine: {what}{where}; no point is lost by it: {remedy}")
