"""``rosgrade export``: what other systems take."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from grader.assignment.load import load_assignment
from grader.authoring import export
from grader.authoring.course_kit import write_kit
from grader.batch.ledger import BATCH_FILE
from grader.cli.options import AssignmentName, ClassFolder, file_option
from grader.cli.screen.console import print_error, print_warning, say
from grader.errors import UsageError
from grader.findings.words import counted
from grader.gradebook.class_files import find_reports, read_class
from grader.gradebook.feedback import class_feedback, letters, write_files
from grader.grading.files import RESULT_FILE
from grader.report.files import refuse_inputs, refuse_part, write_whole
from grader.report.formats.canvas_comments import carrier, upload_zip
from grader.report.formats.canvas_gradebook import canvas_csv, read_canvas
from grader.report.formats.gradebook import grades_csv
from grader.report.formats.mail import address, mail_csv, write_mbox

Folder = Annotated[Path, typer.Option("--out", help="Folder to write to.")]
Results = Annotated[Path, typer.Argument(help="Folder with the reports of a class.")]
File = Annotated[Path, file_option("--output", "-o", text="File to write.")]

Tag = Annotated[
    str,
    typer.Option(
        metavar="PATTERN",
        help="On GitHub, grade only pushes of tags such as `submit*`; by default every push.",
    ),
]
Underlays = Annotated[
    str,
    typer.Option(
        "--underlays",
        metavar="FILE|URL",
        help="Built packages, such as rclcpp: what `rosgrade underlay export` wrote, or where it "
        "lies (https://ADDRESS#sha256=HASH). The set-up imports them instead of building them.",
    ),
]


app = typer.Typer(no_args_is_help=True, add_completion=False, rich_markup_mode=None)


@app.callback()
def other_systems() -> None:
    """Write files for other systems: autograders and gradebooks."""


@app.command()
def gradescope(assignment: AssignmentName, out: Folder = Path(), underlays: Underlays = "") -> None:
    """Write the autograder zip for Gradescope."""
    file = export.gradescope(load_assignment(assignment), out, underlays)
    say(f"Upload to Gradescope: {file}")


@app.command()
def github(
    assignment: AssignmentName,
    action: Annotated[
        str,
        typer.Option(help="Your course's copy of rosgrade: OWNER/REPOSITORY@REF."),
    ],
    out: Folder = Path(),
    tag: Tag = "",
) -> None:
    """Write the workflow for the template repository of an assignment."""
    say(f"Commit and push: {export.github(load_assignment(assignment), out, action, tag)}")


@app.command()
def classroom50(
    assignment: AssignmentName, out: Folder = Path(), underlays: Underlays = ""
) -> None:
    """Write the autograder folder for a Classroom 50 classroom."""
    folder = export.classroom50(load_assignment(assignment), out, underlays)
    say(f"Copy its content to CLASSROOM/autograders/ASSIGNMENT/: {folder}")


@app.command()
def course(
    assignments: Annotated[
        list[str], typer.Argument(metavar="ID...", help="Ids of assignments, or their folders.")
    ],
    out: Annotated[Path, typer.Option("--out", help="A new folder, or an earlier kit.")],
    title: Annotated[str, typer.Option(help="Name of the course.")] = "ROS 2 assignments",
    tag: Tag = "",
    underlays: Underlays = "",
) -> None:
    """Write a course kit: what you give to students.

    It holds rosgrade, the assignments without solutions and hidden checks, a set-up command, a
    GitHub workflow, a devcontainer, and a README.
    """
    kit = write_kit([load_assignment(name) for name in assignments], out, title, tag, underlays)
    say(f"Give this folder to your students, for example as a template repository: {kit}")


@app.command()
def csv(out: Results, output: File = Path("grades.csv")) -> None:
    """Write a CSV with a row for each submission and a column for each check.

    For the folder of a batch, it has the columns and the rows of its grades.csv.
    """
    refuse_inputs([output], _read_of(out))
    rows = read_class(out)
    write_whole(output, grades_csv(rows))
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
    comments: Annotated[
        Path | None,
        typer.Option(help='Also write comments: a zip for "Upload Submissions" in Canvas.'),
    ] = None,
) -> None:
    """Fill a Canvas gradebook. Import it in Canvas under Grades.

    Ends with 1 if a student has no score in it, and says who and why.
    """
    refuse_inputs([output, comments], [canvas, *_read_of(out)])
    try:
        text = canvas.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise UsageError(f"{canvas}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{canvas}: is not UTF-8: give the file as Canvas exported it") from error
    filled = canvas_csv(read_class(out), read_canvas(text, str(canvas)), column)
    write_whole(output, filled.text)
    say(f"{output}: {len(filled.scored)} scores")
    for doubt in filled.doubts:
        print_warning(doubt)
    problems = list(filled.problems)
    if comments is not None:
        problems += _write_comments(comments, out, filled.scored)
    _end(problems)


def _write_comments(file: Path, out: Path, scored: Sequence[str]) -> list[str]:
    """Write comments for all with a score, or with a submission that is unreadable.

    Returns:
        Who gets none, and why.
    """
    comments, problems = {}, []
    for one in class_feedback(out)[0]:
        if one.entry.key not in scored and not one.result.submission.problem:
            continue
        # A batch of before kept no other name.
        name = one.entry.download or carrier([Path(one.entry.source).name])
        if name:
            comments[name] = one.result, one.report.read_bytes()
        else:
            why = "Canvas takes one only for a file that was downloaded from it"
            problems.append(f"{one.entry.key}: no comment: {why}")
    write_whole(file, upload_zip(comments))
    say(f'{file}: {counted(len(comments), "comment")} for "Upload Submissions"')
    return problems


@app.command()
def mail(
    out: ClassFolder,
    folder: Folder = Path("mail"),
    sender: Annotated[str | None, typer.Option("--from", help="Your address.")] = None,
    subject: Annotated[str, typer.Option(help="Of every message.")] = "",
) -> None:
    """Write a message for each student, with the report. Nothing is sent.

    mail.mbox is for a mail program, mail.csv for mail merge. The addresses come from the roster
    with which the class was graded. Ends with 1 if a student gets no message, and says who and why.
    """
    mbox, table = folder / "mail.mbox", folder / "mail.csv"
    refuse_inputs([mbox, table], _read_of(out))
    own = address(sender) if sender is not None else None
    if sender is not None and own is None:
        raise UsageError(f"--from {sender}: is no address; write NAME@HOST")
    found, problems = class_feedback(out)
    messages, without = letters(found, subject)
    write_mbox(mbox, messages, own)
    write_whole(table, mail_csv(messages))
    say(f"{mbox}, {table}: {counted(len(messages), 'message')}; nothing was sent")
    _end([*problems, *without])


@app.command()
def feedback(out: ClassFolder, folder: Folder = Path("feedback")) -> None:
    """Write for each student the files for their repository: a README.md and the report.

    Ends with 1 if a student gets none, and says who and why.
    """
    refuse_part(folder, out / "submissions", f"the results in {out}")
    found, problems = class_feedback(out)
    for one in found:
        write_files(one, folder)
    say(f"{folder}: files for {counted(len(found), 'student')}")
    _end(problems)


def _end(problems: Sequence[str]) -> None:
    for problem in problems:
        print_error(problem)
    if problems:
        raise typer.Exit(1)


def _read_of(out: Path) -> list[Path]:
    return [out / BATCH_FILE, *(folder / RESULT_FILE for folder in find_reports(out))]
