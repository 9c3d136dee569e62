"""``rosgrade list``: the assignments, with their points and titles."""

from __future__ import annotations

from rich.table import Table

from grader.assignment.load import list_assignments, load_assignment
from grader.cli.screen.console import output_console


def list_command() -> None:
    """List the assignments."""
    table = Table(box=None, pad_edge=False)
    for column, side in (("ASSIGNMENT", "left"), ("POINTS", "right"), ("TITLE", "left")):
        table.add_column(column, justify="right" if side == "right" else "left")
    for name in list_assignments():
        loaded = load_assignment(name)
        points = sum(one.spec.points for one in loaded.checks) + loaded.withheld.points
        points += sum(item.points for item in loaded.assignment.manual)
        table.add_row(name, f"{points:g}", loaded.assignment.title)
    output_console().print(table)
