"""``rosgrade start``: a starter package for the student."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grader.cli.options import AssignmentName
from grader.cli.screen.console import say


def start(
    assignment: AssignmentName,
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="Folder for the package, such as the src of your workspace."
        ),
    ] = Path(),
) -> None:
    """Create a package to start from: it builds and runs.

    You write what it does. Existing files are never overwritten.
    """
    from grader.assignment.load import load_assignment
    from grader.starter import write_starter

    for written in write_starter(load_assignment(assignment), folder):
        say(f"Written: {written}")
    say("\nNext, read the task, then grade your work after every save:\n")
    say(f"  rosgrade show {assignment}")
    say(f"  rosgrade watch {assignment} {folder}")
