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
            help="Name of the assignment: lower case letters, digits, underscores; or its folder, "
            "which is called so.",
        ),
    ],
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where its folder goes; by default here.")
    ] = Path(),
) -> None:
    """Write a new assignment, which works as it is.

    You change it bit by bit. A folder ID with assignment.yaml, a handout, a reference solution,
    and mutants: mistakes that the checks must notice. Nothing that is there already is
    overwritten.
    """
    from grader.scaffold import write_assignment

    # A name alone is its own last part, and leaves the folder as it is.
    place = folder / name
    written = write_assignment(place.name or name, place.parent)
    console = output_console()
    console.print(f"Written: {written}", soft_wrap=True)
    console.print("\nNext, look at assignment.yaml in it, and after each change:\n")
    console.print(f"  rosgrade validate {written}", soft_wrap=True)
    console.print(f"  rosgrade selftest {written}", soft_wrap=True)
