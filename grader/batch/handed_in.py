"""What a student handed in: a row of the class."""

from __future__ import annotations

import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from grader.batch.roster import Student
from grader.submission.intake.archive import SUFFIXES
from grader.submission.read.manifest import MANIFEST

# Archives that cannot be read; they are rows all the same, with this as their reason.
FOREIGN = (".rar", ".7z")
_ATTEMPT = re.compile(r"attempt[-_ ]?(\d{1,4})(?!\d)", re.IGNORECASE)


@dataclass(frozen=True)
class HandedIn:
    """A row of the class.

    Attributes:
        key: What the student is called in results; unique.
        path: What was handed in, or None for nothing; those of a team have the same.
        name: The student's, as people write it, or empty.
        problem: Why there is nothing to grade, or what the instructor should look at.
        email: As the roster says it, or empty.
        columns: What the roster says of the student, by header in lower case.
        time: When it was handed in, as in :mod:`~grader.batch.hand_in_time`.
        earlier: Earlier attempts that lie beside it, first to last, with their times.
        attempt_of: Key of the student's row, where this is an earlier attempt.
    """

    key: str
    path: Path | None
    name: str = ""
    late: bool = False
    problem: str = ""
    fault: str = ""
    email: str = ""
    columns: Mapping[str, str] = field(default_factory=dict, compare=False)
    time: tuple[str, str] = ("", "")
    earlier: tuple[tuple[Path, tuple[str, str]], ...] = ()
    attempt_of: str = ""

    def with_problem(self, problem: str) -> HandedIn:
        """The row with a problem more."""
        return replace(self, problem="; ".join(filter(None, (problem, self.problem))))

    def of(self, student: Student) -> HandedIn:
        """The row with what a roster says of its student."""
        return replace(
            self,
            key=student.key,
            name=student.name,
            problem=student.problem,
            email=student.email,
            columns=student.columns,
        )


@dataclass(frozen=True)
class Entry:
    """A file or folder of the class, with the names that may tell whose it is."""

    key: str
    path: Path
    names: tuple[str, ...]
    name: str = ""
    late: bool = False
    fault: str = ""
    time: tuple[str, str] = ("", "")
    attempts: tuple[tuple[Path, tuple[str, str]], ...] = ()


def row_of(entry: Entry) -> HandedIn:
    """The row of an entry, before a roster says whose it is."""
    last = entry.attempts[-1][0] if entry.attempts else entry.path
    path = None if entry.fault else _archive_in(last) or last
    row = HandedIn(entry.key, path, entry.name, entry.late, fault=entry.fault)
    earlier = tuple((_archive_in(path) or path, time) for path, time in entry.attempts[:-1])
    return replace(row, time=entry.time, earlier=earlier)


def stem_of(item: Path) -> str:
    """The name of a file or folder without the suffix of an archive."""
    known = (*SUFFIXES, *FOREIGN)
    suffix = next((s for s in known if item.is_file() and item.name.lower().endswith(s)), "")
    return item.name[: len(item.name) - len(suffix)] or item.name


def _archive_in(folder: Path) -> Path | None:
    """The submission in a folder that a platform made for it, as Moodle does; else None."""
    try:
        inside = list(folder.iterdir()) if folder.is_dir() else []
        # An archive in a student's repository is only a part of the submission.
        if any(item.name == ".git" for item in inside):
            return None
        return only_archive({item.name: item for item in inside if not is_ignored(item)})
    except OSError:
        # Reading it fails later, with its reason.
        return None


def attempts_in(folder: Path) -> tuple[Path, ...]:
    """The attempts in the folder of a student, by their numbers; none if it holds other things."""
    try:
        inside = [item for item in folder.iterdir() if not is_ignored(item)]
    except OSError:
        return ()
    matches = {item: _ATTEMPT.match(item.name) for item in inside}
    numbers = {item: int(match[1]) for item, match in matches.items() if match}
    plain = all(item.is_dir() or item.name.lower().endswith(SUFFIXES) for item in inside)
    complete = plain and len(set(numbers.values())) == len(inside)
    return tuple(sorted(numbers, key=numbers.__getitem__)) if complete else ()


def only_archive(files: Mapping[str, Path]) -> Path | None:
    """The only archive among some files, perhaps with a report beside it; else None."""
    archives = [file for name, file in files.items() if name.lower().endswith(SUFFIXES)]
    # A link may lead to the work of another student.
    plain = all(stat.S_ISREG(file.lstat().st_mode) for file in files.values())
    return archives[0] if len(archives) == 1 and plain and MANIFEST not in files else None


def is_ignored(item: Path) -> bool:
    """Whether a file is left aside: hidden, or of macOS."""
    return item.name.startswith(".") or item.name == "__MACOSX"
