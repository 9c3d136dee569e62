"""What a student handed in: a row of the class before it is graded."""

from __future__ import annotations

import stat
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from grader.batch.ledger import Entry
from grader.batch.roster import Student
from grader.submission.intake.archive import SUFFIXES
from grader.submission.read.manifest import MANIFEST

# Archives that cannot be read; they are rows all the same, with this as their reason.
FOREIGN = (".rar", ".7z")
NOTHING = "handed in nothing"


@dataclass(frozen=True)
class Collected(Entry):
    """A row of the class, with what the ledger does not write down about it.

    Attributes:
        path: What was handed in, or None for nothing; those of a team have the same.
        item: The file or folder of the class that it is or lies in.
        names: Names that may tell whose it is.
        columns: What the roster says of the student, by header in lower case.
    """

    path: Path | None = None
    item: Path = Path()
    names: tuple[str, ...] = ()
    columns: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def submission(self) -> object:
        """Where it lies, by which it is known before its hash is."""
        return self.path or self.sha256

    @property
    def handed_in_fields(self) -> dict[str, Any]:
        """See :class:`Entry`; and where it lies."""
        return {**super().handed_in_fields, "path": self.path}

    def of(self, student: Student) -> Collected:
        """The row with what a roster says of its student."""
        known = replace(self, key=student.key, name=student.name, email=student.email)
        return replace(known, columns=student.columns)

    def at(self, time: tuple[str, str]) -> Collected:
        """The row with when it was handed in, and what tells that."""
        return replace(self, handed_in=time[0], handed_in_from=time[1])


def stem_of(item: Path) -> str:
    """The name of a file or folder without the suffix of an archive."""
    known = (*SUFFIXES, *FOREIGN)
    suffix = next((s for s in known if item.is_file() and item.name.lower().endswith(s)), "")
    return item.name[: len(item.name) - len(suffix)] or item.name


def submission_in(item: Path) -> Path:
    """The only archive in a folder that a platform made for it, as Moodle does; else the item."""
    try:
        inside = list(item.iterdir()) if item.is_dir() else []
        # An archive in a student's repository is only a part of the submission.
        if not any(one.name == ".git" for one in inside):
            return only_archive({one.name: one for one in inside if not is_ignored(one)}) or item
    except OSError:
        # Reading it fails later, with its reason.
        pass
    return item


def only_archive(files: Mapping[str, Path]) -> Path | None:
    """The only archive among some files, perhaps with a report beside it; else None."""
    archives = [file for name, file in files.items() if name.lower().endswith(SUFFIXES)]
    # A link may lead to the work of another student.
    plain = all(stat.S_ISREG(file.lstat().st_mode) for file in files.values())
    return archives[0] if len(archives) == 1 and plain and MANIFEST not in files else None


def is_ignored(item: Path) -> bool:
    """Whether a file is left aside: hidden, or of macOS."""
    return item.name.startswith(".") or item.name == "__MACOSX"
