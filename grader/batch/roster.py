"""The roster of a class: who should have handed in, and under which names they may appear."""

from __future__ import annotations

import csv
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from grader.course.load import comparable_name
from grader.errors import UsageError
from grader.submission.intake.paths import shown

# Column headers, as Canvas, Gradescope, GitHub Classroom and people write them.
_COLUMNS = {
    "id": ("id", "student id", "student_id", "sid", "sis user id", "number", "matriculation"),
    "login": ("login", "username", "user", "sis login id", "github", "github username"),
    "email": ("email", "e-mail", "mail"),
    "name": ("name", "student", "student name", "full name"),
    "submission": ("submission", "path", "file", "folder", "repository", "repo", "url"),
}
_NO_LETTER = re.compile(r"[\W_]+")


@dataclass(frozen=True)
class Student:
    """One row of a roster; ``columns`` is all that it says, by header in lower case."""

    row: int
    id: str = ""
    login: str = ""
    email: str = ""
    name: str = ""
    submission: str = ""
    columns: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def key(self) -> str:
        """What the student is called in results."""
        return shown(self.login or self.id or self.email or self.name)

    @property
    def logins(self) -> frozenset[str]:
        """What identifies the student, as :func:`comparable_name`: number, login, address.

        Without a login the part of the address before the @ stands for it.
        """
        local = self.email.partition("@")[0]
        return frozenset(map(comparable_name, (self.id, self.login or local, self.email))) - {""}

    @property
    def names(self) -> frozenset[str]:
        """Each :func:`comparable_name` of the whole name: ``ana lopez``, ``lopez_ana``."""
        forms = {self.name}
        for form in name_forms(self.name):
            words = form.replace(",", " ").split()
            forms |= {between.join(words) for between in (" ", "_", "-", ".", "")}
            # Canvas' way.
            forms.add(_letters(form))
        return frozenset(map(comparable_name, forms)) - {""}

    @property
    def resembling(self) -> frozenset[str]:
        """Names that may mean the student, as :func:`resemblance`."""
        local = self.email.partition("@")[0]
        forms = (self.id, self.login, self.email, local, *name_forms(self.name))
        return frozenset(resemblance(form) for form in forms if form)


@dataclass(frozen=True)
class Roster:
    """A class."""

    students: tuple[Student, ...]
    problems: tuple[str, ...] = ()


def resemblance(text: str) -> str:
    """What names have in common that are written alike: letters and digits, without accents."""
    if not text.isascii():
        split = unicodedata.normalize("NFKD", text)
        text = "".join(one for one in split if not unicodedata.combining(one))
    folded = text.casefold()
    return _letters(folded) or folded


def _letters(text: str) -> str:
    return _NO_LETTER.sub("", text)


def name_forms(name: str) -> tuple[str, ...]:
    """First and last name in both orders: ``Lopez, Ana`` is ``Ana Lopez``."""
    last, comma, first = name.partition(",")
    if comma:
        return (name, f"{first} {last}")
    words = name.split()
    return (name, " ".join((words[-1], *words[:-1]))) if len(words) > 1 else (name,)


def read_roster(file: Path) -> Roster:
    """Read a roster: CSV with commas, semicolons or tabs, and a header."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise UsageError(f"{file}: cannot be read: {error.strerror}") from error
    try:
        return parse_roster(data.decode("utf-8-sig"), str(file))
    except UnicodeDecodeError as error:
        raise UsageError(f"{file}: is not UTF-8; save it as “CSV UTF-8”") from error


def parse_roster(text: str, source: str) -> Roster:
    """Read the text of a roster."""
    lines = text.splitlines(keepends=True)
    delimiter = max(",;\t", key=lines[0].count) if lines else ","
    reader = csv.reader(lines, delimiter=delimiter, strict=True)
    rows: list[tuple[int, list[str]]] = []
    try:
        for row in reader:
            rows.append((reader.line_num, [cell.strip() for cell in row]))
    except csv.Error as error:
        line = rows[-1][0] + 1 if rows else 1
        raise UsageError(f'{source}:{line}: is not CSV: is a quote (") missing? {error}') from error
    header = [cell.casefold() for cell in rows[0][1]] if rows else []
    columns = {
        field: next(header.index(name) for name in names if name in header)
        for field, names in _COLUMNS.items()
        if not set(names).isdisjoint(header)
    }
    if not set(columns) - {"submission"}:
        raise UsageError(
            f"{source}:1: no column says who a student is; name one of them id, login, email or "
            f"name (there are: {', '.join(header) or 'none'})"
        )
    return _collect(header, columns, rows[1:])


def _collect(
    header: list[str], columns: Mapping[str, int], rows: Sequence[tuple[int, list[str]]]
) -> Roster:
    students: dict[str, Student] = {}
    problems: list[str] = []
    for line, cells in rows:
        # Canvas writes a row of the most points below its header.
        if not any(cells) or cells[0].casefold().startswith("points possible"):
            continue
        values = {field: cells[column] for field, column in columns.items() if column < len(cells)}
        student = Student(line, **values, columns=dict(zip(header, cells, strict=False)))
        if not student.key:
            problems.append(f"row {line}: has no name")
            continue
        first = students.setdefault(comparable_name(student.key), student)
        if first is not student:
            problems.append(f"row {line}: {student.key} is in row {first.row} already")
    return Roster(tuple(students.values()), tuple(problems))
