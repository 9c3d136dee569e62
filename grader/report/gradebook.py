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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from grader.checks.finding import Status
from grader.errors import UsageError
from grader.nearest import did_you_mean
from grader.report import words
from grader.report.clean import one_line
from grader.report.result_model import Result

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
_OPTIONAL = ("SIS User ID", "SIS Login ID", "Integration ID", "Root Account")


@dataclass(frozen=True)
class CanvasExport:
    """A gradebook as Canvas exported it.

    Attributes:
        identity: Headers of the columns that say who a student is.
        columns: Headers of the other columns.
        points: What it says of the points of each of them: a number, ``(read only)``, or nothing.
        students: Their identity cells, a row each.
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
        text: CSV.
        filled: Students with a score.
        problems: What an instructor must know: who could not be matched, who is not graded.
        doubts: What may be meant so: that Canvas counts other points.
    """

    text: str
    filled: int
    problems: tuple[str, ...]
    doubts: tuple[str, ...]


def plain_csv(results: Sequence[Result]) -> str:
    """A row for each submission, a column for each check.

    Args:
        results: All of one assignment.

    Returns:
        CSV. What could not be judged is an empty cell, and so is the score of a submission that
        is not graded.

    Raises:
        UsageError: There are none, or they are of several assignments.
    """
    _one_assignment(results)
    checks: dict[str, float] = {}
    for result in results:
        for check in result.checks:
            checks.setdefault(check.id, check.max_points)
    header = [f"{name} ({words.number(most)})" for name, most in checks.items()]
    rows = [["submission", "score", "max_score", "graded", *header]]
    for result in results:
        earned = {
            check.id: "" if check.status is Status.ERROR else words.number(check.points)
            for check in result.checks
        }
        rows.append(
            [
                cell(result.submission.id),
                _score(result),
                words.number(result.max_score),
                "yes" if result.graded else "no",
                *(earned.get(name, "") for name in checks),
            ]
        )
    return _csv(rows)


def read_canvas(text: str, name: str = "the Canvas export") -> CanvasExport:
    """Read a gradebook as Canvas exports it, with commas or with semicolons.

    Args:
        text: The file.
        name: What to call it in errors.

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
    results: Sequence[Result], export: CanvasExport, column: str | None = None
) -> CanvasFile:
    """Fill a Canvas gradebook.

    Args:
        results: All of one assignment.
        export: The course's own gradebook.
        column: Title of the assignment in Canvas, with or without its number; by default the
            title of the column that the export has for the assignment's id.

    Raises:
        UsageError: Canvas would drop the column or skip it, or no result fits a student.
    """
    assignment = _one_assignment(results)
    title = _column(export, column or assignment)
    ours = max(result.max_score for result in results)
    # Canvas takes this row for a change of the assignment, so what it says itself is kept.
    points = export.points.get(title) or words.number(ours)
    rows = [
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
    taken: dict[int, str] = {}
    for result in results:
        who = one_line(result.submission.id)
        found = _students(export, result.submission.id)
        if len(found) != 1:
            why = "no student of that name or number" if not found else "several students"
            problems.append(f"{who}: not matched, {why} in the gradebook")
        elif found[0] in taken:
            problems.append(f"{who}: the same student as {taken[found[0]]}, left out")
        elif result.score is None:
            problems.append(f"{who}: not graded, so the cell is left as it is")
        elif title in export.excused[found[0]]:
            problems.append(f"{who}: excused in Canvas, so the cell is left as it is")
        else:
            taken[found[0]] = who
            name, *rest = export.students[found[0]]
            # Names are free text; the numbers after them are what Canvas matches by.
            rows.append([cell(name), *rest[:-1], cell(rest[-1]), _score(result)])
    if not taken:
        raise UsageError("\n".join(["no score could be filled in:", *problems]))
    return CanvasFile(_csv(rows), len(taken), tuple(problems), doubts)


def cell(text: str) -> str:
    """Text for a cell in one line, which no spreadsheet takes for a formula.

    Source: OWASP, "CSV Injection".
    """
    shown = one_line(text)
    return f"'{shown}" if shown.lstrip().startswith(_FORMULA) else shown


def _score(result: Result) -> str:
    return "" if result.score is None else words.number(result.score)


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
        raise UsageError(f"Canvas skips the column {title!r}: nobody may change it there")
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
