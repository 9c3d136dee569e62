"""``rosgrade new``: a new assignment's folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grader.cli.screen.console import output_console


def new(
    name: Annotated[
        str,
        typer.Argument(
            metavar="ID",
            help="Name of the assignment (lower case letters, digits, underscores), or a folder of "
            "this name.",
        ),
    ],
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Parent folder; by default the current folder.")
    ] = Path(),
) -> None:
    """Write a small new assignment that works.

    Creates a folder ID with assignment.yaml, a handout, a reference solution, and mutants:
    mistakes that must lose points. Change it step by step. Existing files are never
    overwritten.
    """
    from grader.scaffold import write_assignment

    # A name alone is its own last part, and leaves the folder as it is.
    place = folder / name
    written = write_assignment(place.name or name, place.parent)
    console = output_console()
    console.print(f"Written: {written}", soft_wrap=True)
    console.print("\nNext, edit assignment.yaml in this folder, and after each change run:\n")
    console.print(f"  rosgrade validate {written}", soft_wrap=True)
    console.print(f"  rosgrade selftest {written}", soft_wrap=True)
