"""``rosgrade export``: what other systems take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grader.cli.console import output_console, print_error, print_warning
from grader.cli.options import AssignmentName

Assignment = AssignmentName
Folder = Annotated[Path, typer.Option("--out", help="Where to.")]
Results = Annotated[Path, typer.Argument(help="Folder with the reports of a class.")]
File = Annotated[Path, typer.Option("--output", "-o", help="File to write.")]

app = typer.Typer(
    help="Write what other systems take, such as autograders.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@app.command()
def gradescope(assignment: Assignment, out: Folder = Path()) -> None:
    """Write the autograder zip that is uploaded to Gradescope."""
    from grader import export
    from grader.assignment.load import load_assignment

    _say(f"Upload to Gradescope: {export.gradescope(load_assignment(assignment), out)}")


@app.command()
def github(
    assignment: Assignment,
    action: Annotated[
        str,
        typer.Option(help="Where the course keeps rosgrade: OWNER/REPOSITORY@REF."),
    ],
    out: Folder = Path(),
) -> None:
    """Write the workflow for the template repository of an assignment."""
    from grader import export
    from grader.assignment.load import load_assignment

    _say(f"Commit and push: {export.github(load_assignment(assignment), out, action)}")


@app.command()
def classroom50(assignment: Assignment, out: Folder = Path()) -> None:
    """Write the autograder folder for a Classroom 50 classroom."""
    from grader import export
    from grader.assignment.load import load_assignment

    folder = export.classroom50(load_assignment(assignment), out)
    _say(f"Copy its content to CLASSROOM/autograders/ASSIGNMENT/: {folder}")


@app.command()
def csv(out: Results, output: File = Path("grades.csv")) -> None:
    """Write a CSV with a row for each submission and a column for each check."""
    from grader.batch.rendering import read_results
    from grader.report.files import write_whole
    from grader.report.gradebook import plain_csv

    results = read_results(out)
    write_whole(output, plain_csv(results))
    _say(f"{output}: {len(results)} submissions")


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
) -> None:
    """Fill a Canvas gradebook, to import in Canvas under Grades.

    Ends with 1 if somebody has no score in it; who and why is said.
    """
    from grader.batch.rendering import read_results
    from grader.errors import UsageError
    from grader.report.files import write_whole
    from grader.report.gradebook import canvas_csv, read_canvas

    try:
        text = canvas.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise UsageError(f"{canvas}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{canvas}: is not UTF-8: name the file as Canvas exports it") from error
    filled = canvas_csv(read_results(out), read_canvas(text, str(canvas)), column)
    write_whole(output, filled.text)
    _say(f"{output}: {filled.filled} scores")
    for doubt in filled.doubts:
        print_warning(doubt)
    for problem in filled.problems:
        print_error(problem)
    if filled.problems:
        raise typer.Exit(1)


def _say(text: str) -> None:
    output_console().print(text, soft_wrap=True)
