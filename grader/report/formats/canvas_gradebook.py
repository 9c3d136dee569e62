"""A gradebook to import into Canvas, made from the course's own Canvas export.

Canvas matches rows by its own identity columns: they are kept as they are, and one column is added
for the assignment. Students without a result have no row, so that nothing of theirs is touched.
Source: canvas-lms, ``GradebookImporter`` and ``GradebookExporter``.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from grader.errors import UsageError
from grader.report.formats.gradebook import cell, common_assignment, csv_text, why_no_score
from grader.report.model.class_row import ClassRow, RowStatus
from grader.report.text.words import number
from grader.spec.nearest_name import did_you_mean
from grader.spec.safe_text import one_line

# Canvas takes columns that are called so for its own totals, and drops them without a word.
_DROPPED = re.compile(
    r"(Current|Final) (Score|Points|Grade)|Override (Score|Grade|Status)|[Ff]inal", re.ASCII
)
_POINTS_POSSIBLE = "Points Possible"
_CANVAS_ID = re.compile(r"\((\d+)\)\s*$")
# How Canvas names what it lets a teacher download: name, perhaps LATE, user, attachment, file.
DOWNLOAD = re.compile(
    r"(?P<name>[^_]+)_(?P<late>LATE_)?(?P<user>\d+)_(?P<attachment>\d+)_(?P<file>.+)", re.DOTALL
)
# What `rosgrade batch` calls such a submission: name and user.
_DOWNLOADED = re.compile(r"^([^_]+)_(\d+)$")
# Canvas adds it to every course.
_TEST_STUDENT = "Student, Test"
_NEVER_RUN = (RowStatus.UNREADABLE, RowStatus.MISSING)
_OPTIONAL = ("SIS User ID", "SIS Login ID", "Integration ID", "Root Account")


@dataclass(frozen=True)
class CanvasExport:
    """A gradebook as Canvas exported it.

    ``identity`` titles the first columns, which say who a student is. ``points`` are those of each
    other column: a number, ``(read only)``, or nothing. ``excused`` are the columns that Canvas
    excuses each student from.
    """

    identity: tuple[str, ...]
    points: Mapping[str, str]
    students: tuple[tuple[str, ...], ...]
    excused: tuple[frozenset[str], ...]


@dataclass(frozen=True)
class CanvasFile:
    """A gradebook to import into Canvas.

    ``scored`` are the ids of the rows whose score is in it; ``problems`` name who has no score in
    it, ``doubts`` what is odd about the column.
    """

    text: str
    scored: tuple[str, ...]
    problems: tuple[str, ...]
    doubts: tuple[str, ...]


def read_canvas(text: str, name: str = "the Canvas export") -> CanvasExport:
    """Read a gradebook as Canvas exports it, with commas or with semicolons."""
    text = text.removeprefix("\N{BYTE ORDER MARK}")
    first = text.partition("\n")[0]
    delimiter = ";" if first.count(";") > first.count(",") else ","
    try:
        rows = [row for row in csv.reader(io.StringIO(text), delimiter=delimiter) if any(row)]
    except csv.Error as error:
        raise UsageError(f"{name}: is not CSV: {error}") from error
    if not rows or not _is_canvas_header(rows[0]):
        raise UsageError(
            f"{name}: not a gradebook of Canvas: its first columns must be Student, ID, "
            "perhaps SIS User ID with SIS Login ID, Integration ID and Root Account, then Section. "
            "Export it in Canvas with Gradebook, Export"
        )
    header, body = rows[0], rows[1:]
    width = _identity_width(header)
    titles = header[width:]
    possible = next((row[width:] for row in body if _POINTS_POSSIBLE in row[0]), [])
    students = [row for row in body if len(row) >= width and _POINTS_POSSIBLE not in row[0]]
    return CanvasExport(
        tuple(header[:width]),
        {title: points.strip() for title, points in zip_longest(titles, possible, fillvalue="")},
        students=tuple(tuple(row[:width]) for row in students),
        excused=tuple(_excused(titles, row[width:]) for row in students),
    )


def _identity_width(header: Sequence[str]) -> int:
    """How many columns say who a student is: all up to the one of the section."""
    return next((n + 1 for n, title in enumerate(header) if "Section" in title), 0)


def _is_canvas_header(header: Sequence[str]) -> bool:
    """Whether the first columns are as Canvas itself demands them."""
    identity = header[: _identity_width(header)]
    if len(identity) < 3:
        return False
    first, second, *optional, _section = identity
    in_order = [title for title in _OPTIONAL if title in optional]
    needs_login = "SIS User ID" in optional
    return (
        "Student" in first
        and "ID" in second
        and optional == in_order
        and ("SIS Login ID" in optional or not needs_login)
    )


def _excused(titles: Sequence[str], cells: Sequence[str]) -> frozenset[str]:
    """The columns with EX, by which Canvas excuses a student."""
    return frozenset(
        title for title, text in zip(titles, cells, strict=False) if text.strip().casefold() == "ex"
    )


def canvas_csv(
    rows: Sequence[ClassRow], export: CanvasExport, column: str | None = None
) -> CanvasFile:
    """Fill a Canvas gradebook.

    Students of the gradebook that no row fits handed in nothing.

    Args:
        column: Title of the assignment in Canvas, with or without its number; by default the
            title of the column that the export has for the assignment's id.
    """
    results = [row.result for row in rows if row.result is not None]
    assignment = common_assignment(results)
    title = _column(export, column or assignment)
    max_score = max(result.final_max_score for result in results)
    # Canvas takes this row for a change of the assignment, so what it says itself is kept.
    points = export.points.get(title) or number(max_score)
    table = [
        [*export.identity, title],
        [f"    {_POINTS_POSSIBLE}", *[""] * (len(export.identity) - 1), points],
    ]
    problems: list[str] = []
    scored: list[str] = []
    taken: dict[int, str] = {}
    for who, row, students in _matched(rows, export):
        if len(students) != 1:
            why = "several students" if students else "no student of that name or number"
            problems.append(f"{who}: not matched, {why} in the gradebook")
            continue
        (student,) = students
        is_excused = title in export.excused[student]
        if row.status is RowStatus.MISSING and (student in taken or is_excused):
            # An excused student owes nothing.
            continue
        if student in taken:
            problems.append(f"{who}: the same student as {taken[student]}, left out")
        elif is_excused or row.score is None:
            why = "excused in Canvas" if is_excused else why_no_score(row)
            problems.append(f"{who}: {why}, so the cell is left as it is")
        else:
            name, *ids, section = export.students[student]
            # Names are free text; the numbers after them are what Canvas matches by.
            table.append([cell(name), *ids, cell(section), number(row.score)])
            scored.append(row.id)
        if is_excused or row.score is not None:
            taken.setdefault(student, who)
    if not scored:
        raise UsageError("\n".join(["no score could be filled in:", *problems]))
    doubts = tuple(_doubts(export, title, points, max_score))
    return CanvasFile(csv_text(table), tuple(scored), tuple(problems), doubts)


def _doubts(export: CanvasExport, title: str, points: str, max_score: float) -> Iterator[str]:
    """What is odd about the column, a sentence each."""
    if _value(points) != max_score:
        yield (
            f"{title} has {points} points in Canvas and {number(max_score)} here; the scores are "
            "filled in without scaling"
        )
    if title not in export.points:
        others = [other for other in export.points if not _DROPPED.search(other)]
        known = [_without_id(other) for other in others]
        listed = f" There are: {', '.join(known) or 'none'}."
        yield (
            f"the gradebook has no column {title!r}: Canvas will offer to make a new assignment of "
            f"it.{did_you_mean(title, known) or listed}"
        )


def _value(text: str) -> float | None:
    """A number as Canvas reads it: the last mark is the decimal one; None where it is none."""
    *thousands, last = re.split("[.,]", text)
    try:
        return float(f"{''.join(thousands)}.{last}" if thousands else last)
    except ValueError:
        return None


def _without_id(title: str) -> str:
    """The title of a column without the number that Canvas adds."""
    return _CANVAS_ID.sub("", title).strip()


def _matched(
    rows: Sequence[ClassRow], export: CanvasExport
) -> Iterator[tuple[str, ClassRow, list[int]]]:
    """Who each row is of, the row, and the students of the gradebook that it may belong to.

    Behind them come the students that no row belongs to, with a row that says so.
    """
    with_row: set[int] = set()
    # A grade goes before what has none, such as an earlier submission that is unreadable.
    for row in sorted(rows, key=lambda row: row.status in _NEVER_RUN):
        students = _students(export, row.id)
        with_row.update(students)
        yield one_line(row.id), row, students
    for index, (name, id_, *_) in enumerate(export.students):
        if index not in with_row and name != _TEST_STUDENT:
            yield f"{one_line(name)} ({one_line(id_)})", ClassRow(id_, missing=True), [index]


def _column(export: CanvasExport, wanted: str) -> str:
    """The title of the column to fill, an existing one or a new one."""
    fitting = [title for title in export.points if wanted in (title, _without_id(title))]
    if len(fitting) > 1:
        raise UsageError(
            f"the gradebook has {wanted!r} several times: {', '.join(fitting)}. Give one full title"
        )
    title = fitting[0] if fitting else cell(wanted)
    dropped = _DROPPED.search(title)
    if dropped:
        raise UsageError(
            f"Canvas drops the column {title!r} without a message, because its name has "
            f"{dropped[0]!r} in it, as the totals of Canvas do: rename the assignment there"
        )
    if re.search(r"read\s+only", export.points.get(title, "")):
        raise UsageError(f"Canvas skips the column {title!r}: it is read-only there")
    return title


def _students(export: CanvasExport, submission: str) -> list[int]:
    """Students that a submission may belong to, by the best of what identifies it."""
    keys = [(title, submission) for title in ("ID", *_OPTIONAL[:2], "Student")]
    if download := DOWNLOAD.match(submission):
        keys.insert(0, ("ID", download["user"]))
    for title, value in keys:
        if title in export.identity:
            students = _students_with(export, export.identity.index(title), value)
            if students:
                return students
    downloaded = _DOWNLOADED.match(submission)
    if downloaded is None:
        return []
    # A login may look like this too, so the name has to fit as well.
    name, id_ = downloaded.groups()
    return [n for n in _students_with(export, 0, name) if export.students[n][1].strip() == id_]


def _students_with(export: CanvasExport, column: int, value: str) -> list[int]:
    """Students with a value in a column; of a name only the letters count, in either order."""
    is_same = _is_same_name if column == 0 else _is_same_text
    return [n for n, student in enumerate(export.students) if is_same(student[column], value)]


def _is_same_text(text: str, value: str) -> bool:
    return text.strip().casefold() == value.casefold()


def _is_same_name(text: str, value: str) -> bool:
    parts = text.split("," if "," in text else None)
    return _letters(value) in (_letters("".join(parts)), _letters("".join(reversed(parts))))


def _letters(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).casefold()
