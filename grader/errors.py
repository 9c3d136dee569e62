"""Every error that rosgrade raises on purpose, one branch per person who can mend it.

RosgradeError
├── UsageError            the caller: wrong argument, missing file
├── AssignmentError       the author of an assignment: bad YAML, with file and line
├── SubmissionError       the student: what was handed in cannot be read
└── GraderFault           us or the machine: never costs a student a point

A bug is none of these: it keeps its traceback.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


class RosgradeError(Exception):
    """Base of all errors that are shown as one message, without a traceback."""


class UsageError(RosgradeError):
    """The command was used wrongly: an unknown name, a file that does not exist."""


@dataclass(frozen=True)
class Problem:
    """One mistake in a file.

    Attributes:
        message: What is wrong and what is allowed.
        line: Line in the file, counted from 1, or None where no line can be named.
        where: The place in the document, such as ``checks[2].points``.
    """

    message: str
    line: int | None = None
    where: str = ""


class AssignmentError(RosgradeError):
    """An assignment, world or mutant file says something that it must not."""

    def __init__(self, file: Path, problems: list[Problem]) -> None:
        """Keep the problems as data and make the text from them.

        Args:
            file: The file they were found in.
            problems: At least one problem.
        """
        self.file = file
        self.problems = tuple(problems)
        super().__init__("\n".join(self._lines()))

    def _lines(self) -> list[str]:
        lines = []
        for problem in self.problems:
            place = f"{self.file}:{problem.line}" if problem.line else f"{self.file}"
            where = f"{problem.where}: " if problem.where else ""
            lines.append(f"{place}: {where}{problem.message}")
        return lines


class SubmissionError(RosgradeError):
    """What was handed in cannot be read as a submission; the student can mend it."""


class GraderFault(RosgradeError):
    """Something of ours or of the machine failed; the submission is not graded."""
