"""``rosgrade doctor``: what is there, what is missing, how to get it."""

from __future__ import annotations

import typer
from rich.table import Table

from grader.cli import NOT_GRADED
from grader.cli.screen.console import output_console
from grader.grading.prerequisites import diagnose


def doctor() -> None:
    """Check this machine: ROS, colcon, compilers, sandbox.

    Starts two real nodes and measures how long discovery takes. Ends with 0 if submissions
    can be graded here, else with 3.
    """
    console = output_console()
    table = Table("", "PART", "FOUND", box=None, pad_edge=False)
    usable = True
    for part in diagnose():
        usable = usable and (part.present or not part.required)
        mark = "ok" if part.present else "MISSING" if part.required else "none"
        table.add_row(mark, part.name, part.found if part.present else part.remedy)
    console.print(table, markup=False)
    if not usable:
        console.print("\nSubmissions cannot be graded on this machine yet.")
    raise typer.Exit(0 if usable else NOT_GRADED)
