"""``rosgrade show``: the handout of an assignment."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markdown import Markdown
from rich.table import Table

from grader.assignment.load import load_assignment
from grader.cli.options import AssignmentName, file_option
from grader.cli.screen.console import output_console, say
from grader.errors import UsageError
from grader.report.files import refuse_inputs, write_whole
from grader.report.html.handout import Handout, make_handout, render_handout
from grader.submission.underlay.ros2_command import absence_note


def show(
    assignment: AssignmentName,
    html: Annotated[
        bool, typer.Option("--html", help="Write an HTML page that students can open or print.")
    ] = False,
    out: Annotated[
        Path | None,
        file_option("--out", "-o", text="File of the page; by default ID.html, here."),
    ] = None,
) -> None:
    """Show the handout of an assignment, with its checks and points.

    Shows only the number of hidden checks.
    """
    if out is not None and not html:
        raise UsageError("--out is for the page: add --html")
    loaded = load_assignment(assignment)
    handout: Handout = make_handout(loaded)
    console = output_console()
    if html:
        file = out or Path(f"{handout.id}.html")
        refuse_inputs([file], [loaded.folder])
        write_whole(file, render_handout(handout))
        say(f"Handout: {file}")
        return
    if handout.text:
        console.print(Markdown(handout.text, hyperlinks=False))
        console.print()
    table = Table("CHECK", "WHAT IS ASKED FOR", box=None, pad_edge=False)
    table.add_column("POINTS", justify="right")
    for bound in handout.checks:
        table.add_row(bound.spec.id, bound.title, f"{bound.spec.points:g}")
    for item in handout.manual:
        table.add_row(item.id, f"{item.title} (by a person)", f"{item.points:g}")
    console.print(table)
    console.print(handout.total)
    note = absence_note(handout.text)
    if note:
        say(f"\n{note}")
