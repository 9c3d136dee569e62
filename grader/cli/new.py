"""``rosgrade new``: a new assignment's folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grader.cli.screen.console import say


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
    say(f"Written: {written}")
    say("\nNext, edit assignment.yaml in this folder, and after each change run:\n")
    say(f"  rosgrade validate {written}")
    say(f"  rosgrade selftest {written}")
