"""Arguments and options that several commands share."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grader.cli import NOT_GRADED, POINTS_LOST
from grader.cli.screen.progress import Progress
from grader.errors import UsageError
from grader.machine import resources
from grader.report.files import STANDARD_OUTPUT
from grader.sandbox.choice import Choice

if TYPE_CHECKING:
    from grader.assignment.load import LoadedAssignment
    from grader.grade import Grade
    from grader.sandbox.sandbox import Sandbox

_ARCHIVES = (".zip", ".tar", ".gz", ".tgz", ".rar", ".7z")
_MANIFESTS = ("package.xml", "*/package.xml", "*/*/package.xml", "*/*/*/package.xml")


def assignment_argument(name: str) -> str:
    """See that the first argument is not something else than an assignment."""
    own_ids = sorted(file.parent.name for file in resources.assignments().glob("*/assignment.yaml"))
    path = Path(name)
    if name in own_ids or path.suffix in (".yaml", ".yml"):
        return name
    other = other_than_assignment(path)
    if other is not None:
        advice = f"the first argument is an assignment, such as {next(iter(own_ids), 'hello')}"
        raise UsageError(f"{name} is {other}; {advice}")
    return name


def recording_argument(path: Path) -> Path:
    """See that the first argument is not something else than a recording."""
    other = other_than_assignment(path)
    if other is not None and path.suffix != ".mcap":
        raise UsageError(
            f"{path} is {other}; the first argument is a recording, such as recordings/run.mcap"
        )
    return path


def other_than_assignment(path: Path) -> str | None:
    """What lies at a path instead of an assignment, in words; None if nothing else lies there."""
    if path.suffix == ".mcap" and path.is_file():
        return "a recording"
    if path.is_file():
        return "an archive" if path.suffix in _ARCHIVES else "a file"
    if not path.is_dir() or (path / "assignment.yaml").is_file():
        return None
    if any((path / name).is_file() for name in ("result.json", "batch.json")):
        return "a folder with results"
    for pattern in _MANIFESTS:
        for manifest in sorted(path.glob(pattern)):
            package = manifest.resolve().parent.name
            return f"a folder with the package {package}, such as a submission"
    return "a folder without an assignment.yaml"


AssignmentName = Annotated[
    str, typer.Argument(help="Id of the assignment, or its folder.", callback=assignment_argument)
]
UsedAssignment = Annotated[
    str | None,
    typer.Argument(
        metavar="[ASSIGNMENT]",
        help="Id or folder; by default the assignment that was used for grading.",
    ),
]
ClassFolder = Annotated[Path, typer.Argument(help="Folder of a batch.")]
ReportFolder = Annotated[
    Path | None,
    typer.Option(
        help="Folder for report.html, result.json and the recordings; by default "
        "rosgrade-report/ASSIGNMENT."
    ),
]
Seed = Annotated[
    int | None,
    typer.Option(metavar="N", help="Seed of random values; by default made from the submission."),
]
SetValues = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Value of a variable of the assignment, such as your group's number; may be repeated.",
    ),
]
Port = Annotated[
    int,
    typer.Option(min=0, max=65535, metavar="N", help="Port of the page; 0 means any free port."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress.")]
Verbose = Annotated[
    bool,
    typer.Option("--verbose", "-v", help="Show the build output and what your nodes print."),
]
SandboxChoice = Annotated[
    Choice,
    typer.Option(
        "--sandbox",
        help="Sandbox to build and run the submission in: auto (if bubblewrap works), bwrap "
        "(an error if it does not work), none.",
    ),
]


def file_option(*names: str, text: str) -> Any:
    """An option with a file to write; `-` stands for standard output."""
    return typer.Option(*names, metavar="FILE", help=text, callback=_leaving_standard_output)


def _leaving_standard_output(file: Path | None) -> Path | None:
    """Leave standard output to the file that goes there; messages go to standard error then.

    Here and not in each command, so that none can print a message into the file before.
    """
    if file == STANDARD_OUTPUT:
        sys.stdout = sys.stderr
    return file


@dataclass(frozen=True)
class Part:
    """Which part of an assignment is graded, and with which values."""

    scenario: Annotated[
        list[str] | None,
        typer.Option(metavar="ID", help="Run only this scenario; may be repeated."),
    ] = None
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID", help="Judge only this check and what it requires; may be repeated."
        ),
    ] = None
    seed: Seed = None
    set_values: SetValues = None
    hidden: Annotated[
        bool,
        typer.Option("--hidden", help="Also run and show hidden checks: for instructors."),
    ] = False

    def of(self, assignment: str) -> LoadedAssignment:
        """This part of an assignment."""
        from grader.assignment.selection import select, visible_part

        loaded = load_with_values(assignment, self.set_values)
        if not self.hidden:
            loaded = visible_part(loaded)
        return select(loaded, tuple(self.only or ()), tuple(self.scenario or ()))


def exit_code(grade: Grade) -> int:
    """What a command that graded one submission ends with."""
    if not grade.graded:
        return NOT_GRADED
    return 0 if grade.full_points else POINTS_LOST


def report_folder(folder: Path | None, assignment: str) -> Path:
    """Where a report is written; by default each assignment has its own folder."""
    if folder is not None:
        return folder
    place = Path(assignment).resolve()
    return Path("rosgrade-report", (place.parent if place.is_file() else place).name)


def assignment_places(name: str) -> tuple[Path, Path]:
    """Where an assignment may lie: at that path, or among those of rosgrade's own."""
    return Path(name), resources.assignments() / name


def load_with_values(assignment: str, set_values: list[str] | None) -> LoadedAssignment:
    """The assignment with the values that ``--set NAME=VALUE`` gives its variables."""
    from grader.assignment.load import load_assignment

    loaded = load_assignment(assignment)
    pairs = [text.partition("=") for text in set_values or ()]
    values = {name: value for name, _, value in pairs}
    if not values.keys() <= loaded.values.keys() or not all(values.values()):
        names = ", ".join(loaded.values) or "none"
        raise UsageError(f"--set: expected NAME=VALUE for a variable of the assignment ({names})")
    return replace(loaded, given=values)


def chosen_sandbox(choice: Choice, progress: Progress) -> Sandbox | None:
    """The sandbox that was asked for; says which it is, and what of the shell it leaves out."""
    from grader.machine.ros import find, is_sourced
    from grader.sandbox.trial import choose

    sandbox, notice = choose(choice, resources.cache_folder())
    progress.say(notice or f"sandbox: {sandbox.description if sandbox else 'none'}")
    if is_sourced(os.environ) and (left_out := find().notice):
        progress.say(left_out)
    return sandbox
