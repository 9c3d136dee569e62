"""``rosgrade regrade``: judge recordings again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grader.cli.console import output_console


def regrade(
    path: Annotated[
        Path, typer.Argument(help="A report folder, its recordings folder, or one .mcap file.")
    ],
    assignment: Annotated[
        str | None,
        typer.Argument(help="Id or folder; by default the one that the result names."),
    ] = None,
) -> None:
    """Judge again from the recordings, with the YAML as it is now. Nothing is run.

    Says what changed, and writes report and result anew where there were some.
    """
    from grader.assignment.load import load_assignment
    from grader.batch.files import write_graded
    from grader.batch.regrading import compare, find
    from grader.batch.regrading import regrade as judge_again
    from grader.report.facts import Clock
    from grader.report.terminal import print_grade

    found = find(path)
    loaded = load_assignment(assignment or found.assignment)
    clock = Clock()
    graded = judge_again(loaded, found)
    console = output_console()
    print_grade(console, graded.grade)
    if found.result is not None:
        for line in compare(found.result, graded.grade) or ["no check changed"]:
            console.print(line, markup=False)
        console.print(f"Report: {write_graded(graded, found.folder, clock)}", soft_wrap=True)
    grade = graded.grade
    raise typer.Exit(3 if not grade.graded else 0 if grade.full_points else 1)
