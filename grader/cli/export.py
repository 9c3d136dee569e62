"""``rosgrade export``: what other systems take."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grader.cli.options import AssignmentName
from grader.cli.screen.console import print_error, print_warning, say

if TYPE_CHECKING:
    from grader.report.model.class_row import RowStatus

Folder = Annotated[Path, typer.Option("--out", help="Folder to write to.")]
Results = Annotated[Path, typer.Argument(help="Folder with the reports of a class.")]
File = Annotated[Path, typer.Option("--output", "-o", help="File to write.")]


class Zero(str, Enum):
    """What was never run."""

    UNREADABLE = "unreadable"
    MISSING = "missing"


ZeroFor = Annotated[
    list[Zero] | None,
    typer.Option(
        "--zero",
        help="Give 0 points for unreadable or missing submissions; otherwise they have no score. "
        "May be repeated.",
    ),
]

app = typer.Typer(
    help="Write files for other systems: autograders and gradebooks.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@app.command()
def gradescope(assignment: AssignmentName, out: Folder = Path()) -> None:
    """Write the autograder zip for Gradescope."""
    from grader import export
    from grader.assignment.load import load_assignment

    say(f"Upload to Gradescope: {export.gradescope(load_assignment(assignment), out)}")


@app.command()
def github(
    assignment: AssignmentName,
    action: Annotated[
        str,
        typer.Option(help="Your course's copy of rosgrade: OWNER/REPOSITORY@REF."),
    ],
    out: Folder = Path(),
) -> None:
    """Write the workflow for the template repository of an assignment."""
    from grader import export
    from grader.assignment.load import load_assignment

    say(f"Commit and push: {export.github(load_assignment(assignment), out, action)}")


@app.command()
def classroom50(assignment: AssignmentName, out: Folder = Path()) -> None:
    """Write the autograder folder for a Classroom 50 classroom."""
    from grader import export
    from grader.assignment.load import load_assignment

    folder = export.classroom50(load_assignment(assignment), out)
    say(f"Copy its content to CLASSROOM/autograders/ASSIGNMENT/: {folder}")


@app.command()
def csv(out: Results, output: File = Path("grades.csv"), zero: ZeroFor = None) -> None:
    """Write a CSV with a row for each submission and a column for each check.

    For the folder of a batch, it has the columns and the rows of its grades.csv.
    """
    from grader.batch.class_files import read_class
    from grader.report.files import refuse_inputs, write_whole
    from grader.report.formats.gradebook import grades_csv

    refuse_inputs([output], _read_of(out))
    rows = read_class(out)
    write_whole(output, grades_csv(rows, _statuses(zero)))
    graded = sum(row.graded for row in rows)
    say(f"{output}: {len(rows)} submissions, {graded} of them graded")


@app.command()
def canvas(
    out: Results,
    canvas: Annotated[
        Path, typer.Option("--canvas", help="The course's gradebook, exported from Canvas.")
    ],
    output: File = Path("canvas.csv"),
    column: Annotated[
        str | None,
        typer.Option(help="Title of the assignment in Canvas; by default the assignment's id."),
    ] = None,
    zero: ZeroFor = None,
) -> None:
    """Fill a Canvas gradebook. Import it in Canvas under Grades.

    Ends with 1 if a student has no score in it, and says who and why.
    """
    from grader.batch.class_files import read_class
    from grader.errors import UsageError
    from grader.report.files import refuse_inputs, write_whole
    from grader.report.formats.gradebook import canvas_csv, read_canvas

    refuse_inputs([output], [canvas, *_read_of(out)])
    try:
        text = canvas.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise UsageError(f"{canvas}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{canvas}: is not UTF-8: give the file as Canvas exported it") from error
    export = read_canvas(text, str(canvas))
    filled = canvas_csv(read_class(out), export, column, _statuses(zero))
    write_whole(output, filled.text)
    say(f"{output}: {filled.filled} scores")
    for doubt in filled.doubts:
        print_warning(doubt)
    for problem in filled.problems:
        print_error(problem)
    if filled.problems:
        raise typer.Exit(1)


def _read_of(out: Path) -> list[Path]:
    from grader.batch.class_files import find_reports
    from grader.batch.files import RESULT_FILE
    from grader.batch.ledger import BATCH_FILE

    return [out / BATCH_FILE, *(folder / RESULT_FILE for folder in find_reports(out))]


def _statuses(zero: list[Zero] | None) -> set[RowStatus]:
    from grader.report.model.class_row import RowStatus

    return {RowStatus(one.value) for one in zero or ()}
