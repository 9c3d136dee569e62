"""``rosgrade start``: a starter package for the student."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grader.cli.options import AssignmentName
from grader.cli.screen.console import output_console


def start(
    assignment: AssignmentName,
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="Where the package goes, such as the src of your workspace."
        ),
    ] = Path(),
) -> None:
    """Write a package to begin with: it builds and runs.

    You fill in what it does. Nothing that is there already is overwritten.
    """
    from grader.assignment.load import load_assignment
    from grader.starter import write_starter

    console = output_console()
    for written in write_starter(load_assignment(assignment), folder):
        console.print(f"Written: {written}", soft_wrap=True)
    console.print("\nNext, read what is asked for, and then let every saved file be graded:\n")
    console.print(f"  rosgrade show {assignment}", soft_wrap=True)
    console.print(f"  rosgrade watch {assignment} {folder}", soft_wrap=True)
