"""Gradebooks: the results of a class as CSV.

Canvas matches rows by its own identity columns, so its file is made from the course's own
Canvas export: identity columns kept as they are, one column for the assignment. Students
without a result have no row, so that nothing of theirs is touched.
Source: canvas-lms, ``GradebookImporter`` and ``GradebookExporter``.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from grader.checks.finding import Status
from grader.errors import UsageError
from grader.report.model.class_row import ClassRow, RowStatus
from grader.report.model.result_model import Result
from grader.report.text import words
from grader.safe_text import one_line
from grader.spec.nearest_name import did_you_mean

# Some spreadsheets take the wide forms of East Asian keyboards for the same.
_FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
# Canvas takes columns that are called so for its own totals, and drops them without a word.
_DROPPED = re.compile(
    r"(Current|Final) (Score|Points|Grade)|Override (Score|Grade|Status)|[Ff]inal", re.ASCII
)
_POINTS_POSSIBLE = "Points Possible"
_CANVAS_ID = re.compile(r"\((\d+)\)\s*$")
# How Canvas names what it lets a teacher download: name, perhaps LATE, user, attachment, file.
_DOWNLOAD = re.compile(r"^[^_]+_(?:LATE_)?(\d+)_\d+_")
# What `rosgrade batch` calls whoever handed that in: name and user.
_DOWNLOADED = re.compile(r"^([^_]+)_(\d+)$")
# Canvas adds it to every course.
_TEST_STUDENT = "Student, Test"
_NEVER_RUN = (RowStatus.UNREADABLE, RowStatus.MISSING)
_OPTIONAL = ("SIS User ID", "SIS Login ID", "Integration ID", "Root Account")


@dataclass(frozen=True)
class CanvasExport:
    """A gradebook as Canvas exported it.

    Attributes:
        points: What it says of the points of each of them: a number, ``(read only)``, or nothing.
        excused: For each of these rows, the columns that Canvas excuses the student from.
    """

    identity: tuple[str, ...]
    columns: tuple[str, ...]
    points: Mapping[str, str]
    students: tuple[tuple[str, ...], ...]
    excused: tuple[frozenset[str], ...]


@dataclass(frozen=True)
class CanvasFile:
    """A gradebook to import into Canvas.

    Attributes:
        problems: What an instructor must know: who could not be matched, who is not graded.
    """

    text: str
    filled: int
    problems: tuple[str, ...]
    doubts: tuple[str, ...]


def grades_csv(rows: Sequence[ClassRow], zero: Collection[RowStatus] = ()) -> str:
    """The gradebook of a class: a row for everybody, a column for each check.

    Returns:
        CSV. What could not be judged is an empty cell, and so is the score of a row that has no
        grade.

    Raises:
        UsageError: The results are of several assignments.
    """
    results = [row.result for row in rows if row.result is not None]
    if results:
        _one_assignment(results)
    checks: dict[str, float] = {}
    for result in results:
        for check in result.checks:
            checks.setdefault(check.id, check.max_points)
    header = [f"{name} ({words.number(most)})" for name, most in checks.items()]
    table = [
        [
            *("submission", "name", "late", "status", "score", "max_score", "graded"),
            *header,
            "note",
        ]
    ]
    for row in rows:
        judged = row.result.checks if row.result is not None else ()
        earned = {
            check.id: words.number(check.points)
            for check in judged
            if check.status is not Status.ERROR and row.status is not RowStatus.UNREADABLE
        }
        score = _score(row, zero)
        table.append(
            [
                cell(row.id),
                cell(row.name),
                "yes" if row.late else "",
                row.status.value,
                "" if score is None else words.number(score),
                words.number(row.result.max_score) if row.result is not None else "",
                "yes" if row.graded else "no",
                *(earned.get(name, "") for name in checks),
                cell(row.note),
            ]
        )
    return _csv(table)


def _score(row: ClassRow, zero: Collection[RowStatus]) -> float | None:
    """Points of a row: those that it was given, else 0 only where the instructor wants that."""
    return 0.0 if row.score is None and row.status in zero else row.score


def read_canvas(text: str, name: str = "the Canvas export") -> CanvasExport:
    """Read a gradebook as Canvas exports it, with commas or with semicolons.

    Raises:
        UsageError: It is not one.
    """
    text = text.removeprefix("\N{BYTE ORDER MARK}")
    first = text.partition("\n")[0]
    delimiter = ";" if first.count(";") > first.count(",") else ","
    try:
        rows = [row for row in csv.reader(io.StringIO(text), delimiter=delimiter) if any(row)]
    except csv.Error as error:
        raise UsageError(f"{name}: is not CSV: {error}") from error
    header = rows[0] if rows else []
    end = next((n + 1 for n, title in enumerate(header) if "Section" in title), 0)
    identity = tuple(header[:end])
    _check_identity(identity, name)
    columns = tuple(header[end:])
    said = next((row[end:] for row in rows[1:] if _is_points(row[0])), [])
    points = {title: text.strip() for title, text in zip(columns, said, strict=False)}
    body = [row for row in rows[1:] if len(row) >= end and not _is_points(row[0])]
    return CanvasExport(
        identity,
        columns,
        points,
        students=tuple(tuple(row[:end]) for row in body),
        excused=tuple(frozenset(_excused(columns, row[end:])) for row in body),
    )


def canvas_csv(
    rows: Sequence[ClassRow],
    export: CanvasExport,
    column: str | None = None,
    zero: Collection[RowStatus] = (),
) -> CanvasFile:
    """Fill a Canvas gradebook.

    Args:
        column: Title of the assignment in Canvas, with or without its number; by default the
            title of the column that the export has for the assignment's id.
        zero: What gets 0 points of the rows without a grade. Students of the gradebook that no
            row fits handed in nothing too.

    Raises:
        UsageError: Canvas would drop the column or skip it, or no row fits a student.
    """
    results = [row.result for row in rows if row.result is not None]
    assignment = _one_assignment(results)
    title = _column(export, column or assignment)
    ours = max(result.max_score for result in results)
    # Canvas takes this row for a change of the assignment, so what it says itself is kept.
    points = export.points.get(title) or words.number(ours)
    table = [
        [*export.identity, title],
        [f"    {_POINTS_POSSIBLE}", *[""] * (len(export.identity) - 1), points],
    ]
    doubts: tuple[str, ...] = ()
    if _value(points) != ours:
        doubts = (
            f"{title} has {points} points in Canvas and {words.number(ours)} here; the scores are "
            "filled in as they are",
        )
    if title not in export.columns:
        others = [other for other in export.columns if not _DROPPED.search(other)]
        known = [_CANVAS_ID.sub("", other).strip() for other in others]
        listed = f" There are: {', '.join(known) or 'none'}."
        doubts += (
            f"the gradebook has no column {title!r}: Canvas will offer to make a new assignment of "
            f"it.{did_you_mean(title, known) or listed}",
        )
    problems: list[str] = []
    filled = 0
    taken: dict[int, str] = {}
    for who, row, found in _assigned(rows, export):
        if len(found) != 1:
            why = "no student of that name or number" if not found else "several students"
            problems.append(f"{who}: not matched, {why} in the gradebook")
            continue
        if found[0] in taken:
            if row.status is not RowStatus.MISSING:
                problems.append(f"{who}: the same student as {taken[found[0]]}, left out")
            continue
        score = _score(row, zero)
        if title in export.excused[found[0]]:
            # Who is excused owes nothing.
            if row.status is not RowStatus.MISSING:
                problems.append(f"{who}: excused in Canvas, so the cell is left as it is")
                taken[found[0]] = who
        elif score is None:
            problems.append(f"{who}: {_why_no_score(row)}, so the cell is left as it is")
        else:
            filled += 1
            taken[found[0]] = who
            name, *rest = export.students[found[0]]
            # Names are free text; the numbers after them are what Canvas matches by.
            table.append([cell(name), *rest[:-1], cell(rest[-1]), words.number(score)])
    if not filled:
        raise UsageError("\n".join(["no score could be filled in:", *problems]))
    return CanvasFile(_csv(table), filled, tuple(problems), doubts)


def cell(text: str) -> str:
    """Text for a cell in one line, which no spreadsheet takes for a formula.

    Source: OWASP, "CSV Injection".
    """
    shown = one_line(text)
    return f"'{shown}" if shown.lstrip().startswith(_FORMULA) else shown


def _assigned(
    rows: Sequence[ClassRow], export: CanvasExport
) -> Iterator[tuple[str, ClassRow, list[int]]]:
    """Each row with the students of the gradebook that it may belong to.

    Behind them come the students that no row belongs to.
    """
    known: set[int] = set()
    # A grade goes before what has none, such as what somebody handed in before.
    for row in sorted(rows, key=lambda row: row.status in _NEVER_RUN):
        found = _students(export, row.id)
        known.update(found)
        yield one_line(row.id), row, found
    for number, student in enumerate(export.students):
        if number not in known and student[0] != _TEST_STUDENT:
            who = f"{one_line(student[0])} ({one_line(student[1])})"
            yield who, ClassRow(student[1], missing=True), [number]


def _why_no_score(row: ClassRow) -> str:
    if row.status is RowStatus.MISSING:
        return "handed in nothing"
    problem = row.result.submission.problem if row.result is not None else None
    return "not graded" if problem is None else f"unreadable ({one_line(problem)})"


def _excused(columns: Sequence[str], cells: Sequence[str]) -> Iterator[str]:
    for title, text in zip(columns, cells, strict=False):
        if text.strip().casefold() == "ex":
            yield title


def _value(number: str) -> float | None:
    """A number as Canvas reads it: the last mark is the decimal one; None where it is none."""
    *whole, last = re.split("[.,]", number)
    try:
        return float(f"{''.join(whole)}.{last}" if whole else last)
    except ValueError:
        return None


def _one_assignment(results: Sequence[Result]) -> str:
    names = sorted({result.assignment.id for result in results})
    if not names:
        raise UsageError("there is no result to write")
    if len(names) > 1:
        raise UsageError(f"results of several assignments: {', '.join(names)}")
    return names[0]


def _check_identity(identity: Sequence[str], name: str) -> None:
    """Refuse what Canvas would refuse: its rules for the first columns."""
    middle = list(identity[2:-1])
    known = [title for title in _OPTIONAL if title in middle]
    alone = "SIS User ID" in middle and "SIS Login ID" not in middle
    fits = (
        len(identity) >= 3
        and "Student" in identity[0]
        and "ID" in identity[1]
        and middle == known
        and not alone
    )
    if not fits:
        raise UsageError(
            f"{name}: not a gradebook of Canvas: its first columns must be Student, ID, "
            "perhaps SIS User ID with SIS Login ID, Integration ID and Root Account, then Section. "
            "Export it in Canvas with Gradebook, Export"
        )


def _is_points(first: str) -> bool:
    return _POINTS_POSSIBLE in first


def _column(export: CanvasExport, wanted: str) -> str:
    fitting = [
        title for title in export.columns if wanted in (title, _CANVAS_ID.sub("", title).strip())
    ]
    if len(fitting) > 1:
        raise UsageError(
            f"the gradebook has {wanted!r} several times: {', '.join(fitting)}. Name one whole"
        )
    title = fitting[0] if fitting else cell(wanted)
    dropped = _DROPPED.search(title)
    if dropped:
        raise UsageError(
            f"Canvas drops a column called {title!r} without a word, because it has "
            f"{dropped[0]!r} in it, as its own totals: give the assignment another title there"
        )
    if re.search(r"read\s+only", export.points.get(title, "")):
        raise UsageError(f"Canvas skips the column {title!r}: it is read-only there")
    return title


def _students(export: CanvasExport, submission: str) -> list[int]:
    """Rows that a submission may belong to, by the best of what identifies it."""
    download = _DOWNLOAD.match(submission)
    keys = [(1, download[1])] if download else []
    keys += [
        (export.identity.index(title), submission)
        for title in ("ID", "SIS User ID", "SIS Login ID", "Student")
        if title in export.identity
    ]
    for index, value in keys:
        found = [
            number
            for number, row in enumerate(export.students)
            if value.casefold() in _forms(row[index], name=index == 0)
        ]
        if found:
            return found
    downloaded = _DOWNLOADED.match(submission)
    # A login may look like this too, so the name has to fit as well.
    return [
        number
        for number, row in enumerate(export.students)
        if downloaded
        and row[1].strip() == downloaded[2]
        and _letters(downloaded[1]) in map(_letters, _forms(row[0], name=True))
    ]


def _letters(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).casefold()


def _forms(value: str, *, name: bool) -> set[str]:
    """How a cell may be written: a name also as ``Ana Lopez``, ``ana_lopez`` and ``lopezana``."""
    forms = {value.strip().casefold()}
    if name:
        last, comma, first = value.casefold().partition(",")
        parts = [last.strip(), first.strip()] if comma else value.casefold().split()
        turned = [*reversed(parts)]
        for order in (parts, turned):
            forms |= {" ".join(order), "_".join(order), "".join(order)}
    return forms - {""}


def _csv(rows: Iterable[Sequence[str]]) -> str:
    stream = io.StringIO()
    csv.writer(stream).writerows(rows)
    return stream.getvalue()
