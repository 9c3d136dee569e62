"""``rosgrade regrade``: judge recordings again."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grader.cli.options import Quiet
from grader.cli.screen.console import output_console
from grader.cli.screen.progress import Progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from grader.assignment.load import LoadedAssignment
    from grader.batch.class_regrading import Regraded
    from grader.batch.ledger import Ledger

NOT_GRADED = 3


def regrade(
    path: Annotated[
        Path,
        typer.Argument(help="Folder of a batch, of a report or of recordings, or one .mcap file."),
    ],
    assignment: Annotated[
        str | None,
        typer.Argument(help="Id or folder; by default the one used for grading."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Judge the recordings again with the current YAML. Nothing is run.

    Shows what changed and why, and updates reports and results. For a class, or one submission
    of it, also updates the gradebook and the overview, and keeps the old results.
    """
    from grader.batch.ledger import BATCH_FILE

    if (path / BATCH_FILE).is_file():
        _class(path, assignment, quiet)
    else:
        _one(path, assignment)


def _one(path: Path, assignment: str | None) -> None:
    from grader.assignment.load import load_assignment
    from grader.batch.files import write_graded
    from grader.batch.ledger import Ledger
    from grader.batch.regrading import compare, find, refuse_other, stored_assignment
    from grader.batch.regrading import regrade as judge_again
    from grader.report.model.facts import Clock, RunFacts
    from grader.report.model.result import make_result
    from grader.report.text.terminal import print_grade

    found = find(path)
    batch = Ledger.around(found.folder) if found.result is not None else None
    location = (batch.read().location if batch is not None else None) or found.location
    name = assignment or stored_assignment(path, found.assignment, location, "regrade", str(path))
    loaded = load_assignment(name)
    if found.result is not None:
        refuse_other(found.folder, found.result.assignment.id, loaded)
    clock = Clock()
    graded = judge_again(loaded, found)
    console = output_console()
    console.print(f"Assignment: {loaded.file}", soft_wrap=True)
    result = make_result(graded.grade, graded.recordings, RunFacts(clock.started, clock.elapsed_s))
    print_grade(console, loaded.assignment.title, result)
    if found.result is not None:
        for line in compare(found.result, graded.grade) or ["no check changed"]:
            console.print(line, markup=False)
        if batch is not None:
            _in_class(batch, loaded, found.folder)
        report = write_graded(graded, found.folder, clock).report
        console.print(f"Report: {report}", soft_wrap=True)
    grade = graded.grade
    raise typer.Exit(NOT_GRADED if not grade.graded else 0 if grade.full_points else 1)


def _in_class(batch: Ledger, loaded: LoadedAssignment, folder: Path) -> None:
    """Bring the class that a report belongs to up to date."""
    from grader.batch.class_regrading import regrade_class
    from grader.batch.regrading import regrade_command

    console = output_console()
    with batch.opened() as ledger:
        rows = list(regrade_class(loaded, ledger, folder))
        overview = _write(ledger, rows)
    _say_where(overview)
    results = [row.done.result for row in rows if row.done.result is not None]
    others = sum(one.assignment.sha256 != loaded.sha256 for one in results)
    if others:
        console.print(
            f"{others} of the class are still graded with another version of the assignment: "
            f"{regrade_command(batch.out, loaded)} judges all of them",
            soft_wrap=True,
        )


def _write(ledger: Ledger, rows: Sequence[Regraded]) -> Path:
    """Write the gradebook and the overview anew; the one until now is kept where it changes."""
    from grader.batch.class_files import GRADES_FILE, write_class
    from grader.batch.ledger import keep_earlier

    if any(row.changes for row in rows):
        keep_earlier(ledger.out / GRADES_FILE)
    return write_class([row.done for row in rows], ledger)


def _say_where(overview: Path) -> None:
    from grader.batch.class_files import GRADES_FILE

    console = output_console()
    console.print(f"Overview: {overview}", soft_wrap=True)
    console.print(f"Grades: {overview.with_name(GRADES_FILE)}", soft_wrap=True)


def _class(path: Path, assignment: str | None, quiet: bool) -> None:
    from grader.assignment.load import load_assignment
    from grader.batch.class_regrading import regrade_class
    from grader.batch.ledger import Ledger
    from grader.batch.regrading import stored_assignment

    console = output_console()
    began_s = time.monotonic()
    rows = []
    with Ledger(path).opened() as ledger, Progress(quiet).shown() as progress:
        written = ledger.read()
        stored = assignment or stored_assignment(
            path, written.assignment, written.location, "regrade", str(path)
        )
        loaded = load_assignment(stored)
        console.print(f"Assignment: {loaded.file}", soft_wrap=True)
        progress.begin("judging", len(written.entries))
        for row in regrade_class(loaded, ledger):
            rows.append(row)
            progress.advance(row.done.entry.key)
        overview = _write(ledger, rows)
    for row in rows:
        for change in row.changes:
            console.print(f"{row.done.entry.key}: {change}", soft_wrap=True)
        if row.problem:
            console.print(f"{row.done.entry.key}: not judged again: {row.problem}", soft_wrap=True)
    gain = [row for row in rows if row.gained > 0]
    lose = [row for row in rows if row.gained < 0]
    doubtful = sum(row.in_doubt for row in rows)
    judged = sum(row.done.fresh for row in rows)
    console.print(
        f"{judged} judged again in {time.monotonic() - began_s:.1f} s: {len(gain)} gain "
        f"{sum(row.gained for row in gain):g} points, {len(lose)} lose "
        f"{-sum(row.gained for row in lose):g} points, "
        f"{sum(bool(row.changes) for row in rows)} with a change",
        soft_wrap=True,
    )
    left = sum(bool(row.problem) for row in rows)
    if left:
        console.print(
            f"{left} not judged again; run them again with `rosgrade batch ... --retry NAME`",
            soft_wrap=True,
        )
    if doubtful:
        console.print(
            f"{doubtful} cannot be judged from what was recorded and are not graded any more; "
            "run them again with `rosgrade batch ... --retry errors`",
            soft_wrap=True,
        )
    _say_where(overview)
    graded = all(
        not row.problem and (row.done.result is None or row.done.result.graded) for row in rows
    )
    raise typer.Exit(0 if graded else NOT_GRADED)
