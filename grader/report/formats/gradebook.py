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
from itertools import zip_longest

from grader.errors import UsageError
from grader.findings.finding import Status
from grader.grade.model import total
from grader.report.model.class_row import ClassRow, RowStatus
from grader.report.model.result_model import AdjustmentPart, Result
from grader.report.text.words import number
from grader.spec.nearest_name import did_you_mean
from grader.spec.safe_text import one_line

# Some spreadsheets take the wide forms of East Asian keyboards for the same.
_FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
_TO_QUOTE = re.compile(r'[",;\t\r\n]')
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


def grades_csv(rows: Sequence[ClassRow]) -> str:
    """The gradebook of a class as CSV: a row for each submission, a column for each check.

    Then come a column for each manual item and one for each other kind of adjustment that there is.
    What could not be judged is an empty cell, and so is the score of a row without a grade.
    """
    results = [row.result for row in rows if row.result is not None]
    if results:
        _one_assignment(results)
    checks: dict[str, float] = {}
    added: dict[str, str] = {}
    for result in results:
        for check in result.checks:
            checks.setdefault(check.id, check.max_points)
        for one in result.adjustments:
            added.setdefault(*_column_of(one))
    table = [
        [
            *("submission", "name", "late", "status", "score", "max_score", "graded"),
            *(f"{name} ({number(most)})" for name, most in checks.items()),
            *added.values(),
            "note",
        ]
    ]
    for row in rows:
        judged = [check for check in row.judged if check.status is not Status.ERROR]
        earned = {check.id: number(check.points) for check in judged}
        sums: dict[str, float] = {}
        for one in row.result.adjustments if row.result is not None and row.judged else ():
            if one.points is not None:
                name = _column_of(one)[0]
                sums[name] = total((sums.get(name, 0.0), one.points))
        table.append(
            [
                cell(row.id),
                cell(row.name),
                "yes" if row.late else "",
                row.status.value,
                "" if row.score is None else number(row.score),
                number(row.result.final_max_score) if row.result is not None else "",
                "yes" if row.graded else "no",
                *(earned.get(name, "") for name in checks),
                *(number(sums[name]) if name in sums else "" for name in added),
                cell(row.note),
            ]
        )
    return csv_text(table)


def _column_of(one: AdjustmentPart) -> tuple[str, str]:
    """The key and the title of the column of an adjustment."""
    if one.kind != "manual":
        # The column `late` says yes or no.
        return one.kind, f"{one.kind} points"
    return f"manual {one.item}", f"{one.item} ({number(one.max_points)})"


def read_canvas(text: str, name: str = "the Canvas export") -> CanvasExport:
    """Read a gradebook as Canvas exports it, with commas or with semicolons."""
    text = text.removeprefix("\N{BYTE ORDER MARK}")
    first = text.partition("\n")[0]
    delimiter = ";" if first.count(";") > first.count(",") else ","
    try:
        rows = [row for row in csv.reader(io.StringIO(text), delimiter=delimiter) if any(row)]
    except csv.Error as error:
        raise UsageError(f"{name}: is not CSV: {error}") from error
    header = rows[0] if rows else []
    end = next((n + 1 for n, title in enumerate(header) if "Section" in title), 0)
    identity, columns = tuple(header[:end]), header[end:]
    middle = identity[2:-1]
    # The rules of Canvas itself for the first columns.
    if not (
        len(identity) >= 3
        and "Student" in identity[0]
        and "ID" in identity[1]
        and middle == tuple(title for title in _OPTIONAL if title in middle)
        and ("SIS Login ID" in middle or "SIS User ID" not in middle)
    ):
        raise UsageError(
            f"{name}: not a gradebook of Canvas: its first columns must be Student, ID, "
            "perhaps SIS User ID with SIS Login ID, Integration ID and Root Account, then Section. "
            "Export it in Canvas with Gradebook, Export"
        )
    body = [row for row in rows[1:] if len(row) >= end and _POINTS_POSSIBLE not in row[0]]
    possible = next((row[end:] for row in rows[1:] if _POINTS_POSSIBLE in row[0]), [])
    return CanvasExport(
        identity,
        {title: text.strip() for title, text in zip_longest(columns, possible, fillvalue="")},
        students=tuple(tuple(row[:end]) for row in body),
        excused=tuple(
            frozenset(
                title
                for title, text in zip(columns, row[end:], strict=False)
                if text.strip().casefold() == "ex"
            )
            for row in body
        ),
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
    assignment = _one_assignment(results)
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
    for who, row, found in _assigned(rows, export):
        if len(found) != 1:
            why = "no student of that name or number" if not found else "several students"
            problems.append(f"{who}: not matched, {why} in the gradebook")
            continue
        (student,) = found
        score, is_excused = row.score, title in export.excused[student]
        # An excused student owes nothing.
        if row.status is RowStatus.MISSING and (student in taken or is_excused):
            continue
        if student in taken:
            problems.append(f"{who}: the same student as {taken[student]}, left out")
        elif is_excused or score is None:
            why = "excused in Canvas" if is_excused else why_no_score(row)
            problems.append(f"{who}: {why}, so the cell is left as it is")
        else:
            name, *rest = export.students[student]
            # Names are free text; the numbers after them are what Canvas matches by.
            table.append([cell(name), *rest[:-1], cell(rest[-1]), number(score)])
            scored.append(row.id)
        if is_excused or score is not None:
            taken.setdefault(student, who)
    if not scored:
        raise UsageError("\n".join(["no score could be filled in:", *problems]))
    doubts = tuple(_doubts(export, title, points, max_score))
    return CanvasFile(csv_text(table), tuple(scored), tuple(problems), doubts)


def csv_text(rows: Iterable[Sequence[str]]) -> str:
    """Rows as CSV (RFC 4180).

    A cell with another separator is quoted too: where the decimal mark is a comma, spreadsheets
    separate by semicolons.
    """
    return "".join(f"{','.join(map(_quoted, row))}\r\n" for row in rows)


def _quoted(text: str) -> str:
    doubled = text.replace('"', '""')
    return f'"{doubled}"' if _TO_QUOTE.search(text) else text


def cell(text: str) -> str:
    """Text for a cell in one line, which no spreadsheet takes for a formula.

    Source: OWASP, "CSV Injection".
    """
    shown = one_line(text)
    return f"'{shown}" if shown.lstrip().startswith(_FORMULA) else shown


def _doubts(export: CanvasExport, title: str, points: str, max_score: float) -> Iterator[str]:
    if _value(points) != max_score:
        yield (
            f"{title} has {points} points in Canvas and {number(max_score)} here; the scores are "
            "filled in without scaling"
        )
    if title not in export.points:
        others = [other for other in export.points if not _DROPPED.search(other)]
        known = [_CANVAS_ID.sub("", other).strip() for other in others]
        listed = f" There are: {', '.join(known) or 'none'}."
        yield (
            f"the gradebook has no column {title!r}: Canvas will offer to make a new assignment of "
            f"it.{did_you_mean(title, known) or listed}"
        )


def _value(text: str) -> float | None:
    """A number as Canvas reads it: the last mark is the decimal one; None where it is none."""
    *whole, last = re.split("[.,]", text)
    try:
        return float(f"{''.join(whole)}.{last}" if whole else last)
    except ValueError:
        return None


def _assigned(
    rows: Sequence[ClassRow], export: CanvasExport
) -> Iterator[tuple[str, ClassRow, list[int]]]:
    """Each row with the students of the gradebook that it may belong to.

    Behind them come the students that no row belongs to.
    """
    known: set[int] = set()
    # A grade goes before what has none, such as an earlier submission that is unreadable.
    for row in sorted(rows, key=lambda row: row.status in _NEVER_RUN):
        found = _students(export, row.id)
        known.update(found)
        yield one_line(row.id), row, found
    for index, student in enumerate(export.students):
        if index not in known and student[0] != _TEST_STUDENT:
            who = f"{one_line(student[0])} ({one_line(student[1])})"
            yield who, ClassRow(student[1], missing=True), [index]


def why_no_score(row: ClassRow) -> str:
    """In a few words."""
    if row.status is RowStatus.MISSING:
        return "handed in nothing"
    if row.status is RowStatus.WAITING:
        return f"waits for a person ({', '.join(map(one_line, row.waits_for))})"
    problem = row.result.submission.problem if row.result is not None else None
    return "not graded" if problem is None else f"unreadable ({one_line(problem)})"


def _one_assignment(results: Sequence[Result]) -> str:
    names = sorted({result.assignment.id for result in results})
    if not names:
        raise UsageError("there is no result to write")
    if len(names) > 1:
        raise UsageError(f"results of several assignments: {', '.join(names)}")
    return names[0]


def _column(export: CanvasExport, wanted: str) -> str:
    fitting = [
        title for title in export.points if wanted in (title, _CANVAS_ID.sub("", title).strip())
    ]
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
    """Rows that a submission may belong to, by the best of what identifies it."""
    download = DOWNLOAD.match(submission)
    keys = [("ID", download["user"])] if download else []
    keys += [(title, submission) for title in ("ID", *_OPTIONAL[:2], "Student")]
    for title, value in keys:
        index = export.identity.index(title) if title in export.identity else None
        if index is not None and (found := _rows_of(export, index, value)):
            return found
    downloaded = _DOWNLOADED.match(submission)
    if downloaded is None:
        return []
    # A login may look like this too, so the name has to fit as well.
    named = _rows_of(export, 0, downloaded[1])
    return [row for row in named if export.students[row][1].strip() == downloaded[2]]


def _rows_of(export: CanvasExport, index: int, value: str) -> list[int]:
    """Rows with a value in a column; of a name only the letters count, in either order."""
    cells = enumerate(student[index] for student in export.students)
    if index:
        return [row for row, text in cells if text.strip().casefold() == value.casefold()]
    names = {row: text.split("," if "," in text else None) for row, text in cells}
    return [
        row
        for row, parts in names.items()
        if _letters(value) in (_letters("".join(parts)), _letters("".join(reversed(parts))))
    ]


def _letters(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).casefold()
