"""The roster of a class: who should have handed in, and under which names they may appear."""

from __future__ import annotations

import codecs
import csv
import io
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from grader.checks.wording import listing
from grader.errors import UsageError
from grader.submission.intake.paths import shown

_MOST_BYTES = 16 * 2**20
# Column headers, as Canvas, Gradescope, GitHub Classroom and people write them.
_COLUMNS = {
    "id": ("id", "student id", "student_id", "sid", "sis user id", "number", "matriculation"),
    "login": ("login", "username", "user", "sis login id", "github", "github username"),
    "email": ("email", "e-mail", "mail"),
    "name": ("name", "student", "student name", "full name"),
    "submission": ("submission", "path", "file", "folder", "repository", "repo", "url"),
}
_POINTS_POSSIBLE = "points possible"
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_EXCEL = "Windows-1252"
"""What Excel writes in Western Europe and America, unless it is asked for UTF-8."""
# How Excel is told the delimiter, in a line before the header.
_DELIMITER = re.compile(r'"?sep=(.)"?\s*\n', re.IGNORECASE)
_NO_LETTER = re.compile(r"[\W_]+")
_END = "end of the roster"


@dataclass(frozen=True)
class Student:
    """One row of a roster.

    Attributes:
        row: Number of its line in the file, the header being 1.
        id: Or empty, as all that follow.
    """

    row: int
    id: str = ""
    login: str = ""
    email: str = ""
    name: str = ""
    submission: str = ""
    problem: str = ""

    @property
    def key(self) -> str:
        """What the student is called in results."""
        return shown(self.login or self.id or self.email or self.name)

    @property
    def logins(self) -> frozenset[str]:
        """What identifies the student, as :func:`written`: number, login, address.

        Without a login the part of the address before the @ stands for it.
        """
        local = self.email.partition("@")[0]
        return frozenset(map(written, (self.id, self.login or local, self.email))) - {""}

    @property
    def names(self) -> frozenset[str]:
        """Each way to write the whole name, as :func:`written`: ``ana lopez``, ``lopez_ana``."""
        forms = {self.name}
        for form in name_forms(self.name):
            words = form.replace(",", " ").split()
            forms |= {between.join(words) for between in (" ", "_", "-", ".", "")}
            # Canvas' way.
            forms.add(_letters(form))
        return frozenset(map(written, forms)) - {""}

    @property
    def resembling(self) -> frozenset[str]:
        """What may be meant for the student, as :func:`resemblance`."""
        local = self.email.partition("@")[0]
        forms = (self.id, self.login, self.email, local, *name_forms(self.name))
        return frozenset(resemblance(form) for form in forms if form)


@dataclass(frozen=True)
class Roster:
    """A class."""

    students: tuple[Student, ...]
    problems: tuple[str, ...] = ()


def written(text: str) -> str:
    """A name as it is compared: case, spaces around it and an accent's encoding do not matter."""
    return " ".join(unicodedata.normalize("NFKC", text).casefold().split())


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
    """Read a roster.

    Args:
        file: CSV with commas, semicolons or tabs and a header; a Canvas export will do.

    Raises:
        UsageError: It cannot be read, or no column names a student.
    """
    try:
        if file.stat().st_size > _MOST_BYTES:
            raise UsageError(f"{file}: is larger than {_MOST_BYTES // 2**20} MiB; is it a roster?")
        data = file.read_bytes()
    except OSError as error:
        raise UsageError(f"{file}: cannot be read: {error.strerror}") from error
    try:
        text, doubt = _decoded(data)
    except UnicodeDecodeError as error:
        raise UsageError(f"{file}: is not UTF-8; save it as “CSV UTF-8”") from error
    roster = parse_roster(text.replace("\r\n", "\n").replace("\r", "\n"), str(file))
    return replace(roster, problems=(*doubt, *roster.problems))


def _decoded(data: bytes) -> tuple[str, tuple[str, ...]]:
    """The text of a file, and what is doubtful about it."""
    if data.startswith(_UTF_16):
        return data.decode("utf-16"), ()
    try:
        return data.decode("utf-8-sig"), ()
    except UnicodeDecodeError:
        # Another encoding of one byte would be read as well, with other letters.
        doubt = f"is not UTF-8 and was read as {_EXCEL}: look at letters with accents"
        return data.decode(_EXCEL), (doubt,)


def parse_roster(text: str, source: str) -> Roster:
    """Read the text of a roster.

    Raises:
        UsageError: No column names a student.
    """
    named = _DELIMITER.match(text)
    first = text.partition("\n")[0]
    delimiter = named[1] if named else max(",;\t", key=first.count)
    reader = csv.reader(io.StringIO(f"{text}\n{_END}\n"), delimiter=delimiter)
    rows: list[tuple[int, list[str]]] = []
    try:
        for row in reader:
            rows.append((reader.line_num, row))
    except csv.Error as error:
        raise UsageError(f"{source}:{reader.line_num}: is not CSV: {error}") from error
    if rows.pop()[1] != [_END]:
        begins = rows[-1][0] + 1 if rows else 1
        raise UsageError(f'{source}:{begins}: a quote (") opens here that nothing closes')
    if named:
        del rows[0]
    header = rows.pop(0)[1]
    columns = _columns(header)
    if not set(columns) - {"submission"}:
        raise UsageError(
            f"{source}:{2 if named else 1}: no column says who a student is; name one of them id, "
            f"login, email or name (there are: {', '.join(header) or 'none'})"
        )
    return _collect(columns, rows)


def _columns(header: Sequence[str]) -> dict[str, int]:
    found: dict[str, int] = {}
    lowered = [cell.strip().casefold() for cell in header]
    for field, names in _COLUMNS.items():
        for name in names:
            if name in lowered and field not in found:
                found[field] = lowered.index(name)
    return found


def _collect(columns: Mapping[str, int], rows: Sequence[tuple[int, list[str]]]) -> Roster:
    students: dict[str, Student] = {}
    again: dict[str, list[int]] = {}
    problems: list[str] = []
    for number, row in rows:
        cells = [cell.strip() for cell in row]
        if not any(cells) or cells[0].casefold().startswith(_POINTS_POSSIBLE):
            continue
        values = {field: cells[column] for field, column in columns.items() if column < len(cells)}
        student = Student(number, **values)
        broken = [field for field, cell in values.items() if "\n" in cell]
        if broken:
            told = f"its {' and '.join(broken)} goes over several lines: is a quote missing?"
            problems.append(f"row {number}: {told}")
            student = replace(student, problem=told)
        if not student.key:
            problems.append(f"row {number}: names nobody")
            continue
        name = written(student.key)
        known = students.setdefault(name, student)
        if known is not student:
            problems.append(f"row {number}: {student.key} is in row {known.row} already")
            again.setdefault(name, []).append(number)
    for name, numbers in again.items():
        told = f"in the roster again in row {listing(map(str, numbers))}"
        problem = "; ".join(part for part in (students[name].problem, told) if part)
        students[name] = replace(students[name], problem=problem)
    return Roster(tuple(students.values()), tuple(problems))
