"""``rosgrade list`` and ``rosgrade show``."""

from __future__ import annotations

from typing import Annotated

import typer

from grader.cli.console import output_console


def list_command() -> None:
    """List the assignments."""
    from rich.table import Table

    from grader.assignment.load import list_assignments, load_assignment

    table = Table(box=None, pad_edge=False)
    for column, side in (("ASSIGNMENT", "left"), ("POINTS", "right"), ("TITLE", "left")):
        table.add_column(column, justify="right" if side == "right" else "left")
    for name in list_assignments():
        loaded = load_assignment(name)
        points = sum(bound.spec.points for bound in loaded.checks)
        table.add_row(name, f"{points:g}", loaded.assignment.title)
    output_console().print(table)


def show(
    assignment: Annotated[str, typer.Argument(help="Id of the assignment, or its folder.")],
) -> None:
    """Show the handout of an assignment, with its checks and points."""
    from rich.markdown import Markdown
    from rich.table import Table

    from grader.assignment.load import load_assignment
    from grader.assignment.model import Visibility

    loaded = load_assignment(assignment)
    console = output_console()
    handout = loaded.folder / "README.md"
    if handout.is_file():
        console.print(Markdown(handout.read_text(encoding="utf-8"), hyperlinks=False))
        console.print()
    table = Table("CHECK", "WHAT IS ASKED FOR", box=None, pad_edge=False)
    table.add_column("POINTS", justify="right")
    hidden = [b for b in loaded.checks if b.spec.visibility is not Visibility.VISIBLE]
    for bound in loaded.checks:
        if bound not in hidden:
            table.add_row(bound.spec.id, bound.title, f"{bound.spec.points:g}")
    console.print(table)
    if hidden:
        points = sum(bound.spec.points for bound in hidden)
        console.print(f"{len(hidden)} more checks ({points:g} points) run at grading.")
