"""Arguments and options that several commands share."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

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
    own = sorted(file.parent.name for file in resources.assignments().glob("*/assignment.yaml"))
    seen = "" if name in own or Path(name).suffix in (".yaml", ".yml") else looks_like(Path(name))
    if seen:
        raise UsageError(f"{name} is {seen}; the first argument is an assignment, such as {own[0]}")
    return name


def recording_argument(path: Path) -> Path:
    """See that the first argument is not something else than a recording."""
    seen = looks_like(path)
    if seen and path.suffix != ".mcap":
        raise UsageError(
            f"{path} is {seen}; the first argument is a recording, such as recordings/run.mcap"
        )
    return path


def looks_like(path: Path) -> str:
    """What there is at a path, in words; empty for an assignment, and where nothing is."""
    if path.is_file():
        kind = "a recording" if path.suffix == ".mcap" else "a file"
        return "an archive" if path.suffix in _ARCHIVES else kind
    if not path.is_dir() or (path / "assignment.yaml").is_file():
        return ""
    if any((path / name).is_file() for name in ("result.json", "batch.json")):
        return "a folder with results"
    manifest = next((file for form in _MANIFESTS for file in sorted(path.glob(form))), None)
    if manifest is not None:
        return f"a folder with the package {manifest.resolve().parent.name}, such as a submission"
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
Chosen = Annotated[
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
    """An option with a file to write; for `-`, standard output, messages go to standard error."""

    def read(file: Path | None) -> Path | None:
        if file == STANDARD_OUTPUT:
            sys.stdout = sys.stderr
        return file

    return typer.Option(*names, metavar="FILE", help=text, callback=read)


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
    chosen: Chosen = None
    hidden: Annotated[
        bool,
        typer.Option("--hidden", help="Also run and show hidden checks: for instructors."),
    ] = False

    def of(self, assignment: str) -> LoadedAssignment:
        """This part of an assignment."""
        from grader.assignment.selection import select, visible_part

        whole = chosen_names(assignment, self.chosen)
        shown = whole if self.hidden else visible_part(whole)
        return select(shown, tuple(self.only or ()), tuple(self.scenario or ()))


def expanded(command: Callable[..., None]) -> Callable[..., None]:
    """Let a parameter of a command that is a dataclass stand for an option for each field."""

    @wraps(command)
    def wrapped(**given: Any) -> None:
        for name, kind in kinds.items():
            given[name] = kind(**{one.name: given.pop(one.name) for one in fields(kind)})
        command(**given)

    hints = get_type_hints(command, include_extras=True)
    kinds: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    defaults: dict[str, Any] = {}
    for name, parameter in signature(command).parameters.items():
        if name in kinds:
            hints |= get_type_hints(kinds[name], include_extras=True)
            defaults |= {one.name: one.default for one in fields(kinds[name])}
        else:
            defaults[name] = parameter.default
    parameters = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=hints[name])
        for name, default in defaults.items()
    ]
    wrapped.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    wrapped.__annotations__ = {name: hints[name] for name in defaults}
    return wrapped


def exit_code(grade: Grade) -> int:
    """What a command that graded one submission ends with."""
    return NOT_GRADED if not grade.graded else 0 if grade.full_points else POINTS_LOST


def report_folder(chosen: Path | None, assignment: str) -> Path:
    """Where a report is written: each assignment has its own folder."""
    place = Path(assignment).resolve()
    return chosen or Path("rosgrade-report", (place.parent if place.is_file() else place).name)


def assignment_places(name: str) -> tuple[Path, Path]:
    """Where an assignment may lie: at that path, or among those of rosgrade's own."""
    return Path(name), resources.assignments() / name


def chosen_names(assignment: str, chosen: list[str] | None) -> LoadedAssignment:
    """The assignment with the values that were chosen for its variables."""
    from grader.assignment.load import load_assignment

    loaded = load_assignment(assignment)
    given = {name: value for name, _, value in (text.partition("=") for text in chosen or ())}
    if not given.keys() <= loaded.values.keys() or not all(given.values()):
        names = ", ".join(loaded.values) or "none"
        raise UsageError(f"--set: expected NAME=VALUE for a variable of the assignment ({names})")
    return replace(loaded, given=given)


def chosen_sandbox(choice: Choice, progress: Progress) -> Sandbox | None:
    """The sandbox that was asked for; says which it is, and what of the shell it leaves out."""
    from grader.machine.ros import find, is_sourced
    from grader.sandbox.trial import choose

    sandbox, notice = choose(choice, resources.cache_folder())
    progress.say(notice or f"sandbox: {sandbox.description if sandbox else 'none'}")
    if is_sourced(os.environ) and (left_out := find().notice):
        progress.say(left_out)
    return sandbox
