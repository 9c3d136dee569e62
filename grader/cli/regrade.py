"""``rosgrade regrade``: judge recordings again."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from grader.assignment.load import load_assignment
from grader.batch.ledger import Ledger
from grader.batch.used_assignment import load_used
from grader.cli import NOT_GRADED
from grader.cli.options import Quiet, UsedAssignment, exit_code
from grader.cli.screen.console import output_console, say
from grader.cli.screen.progress import Progress
from grader.gradebook.class_files import GRADES_FILE, class_rows
from grader.gradebook.class_regrading import Regraded, regrade_class, write_regraded
from grader.grading.attempts import with_history
from grader.grading.files import REPORT_FILE, write_graded
from grader.grading.regrading import compare, find_recordings, refuse_other
from grader.grading.regrading import regrade as judge_again
from grader.report.model.facts import Clock, RunFacts
from grader.report.model.result import make_result
from grader.report.text.terminal import print_grade

NOTHING_WRITTEN = "Nothing was written (--dry-run)."


def regrade(
    path: Annotated[
        Path,
        typer.Argument(help="Folder of a batch, of a report or of recordings, or one .mcap file."),
    ],
    assignment: UsedAssignment = None,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run", help="Show which students would gain or lose points, and write nothing."
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Judge the recordings again with the current YAML. Nothing is run.

    Shows what changed and why, and updates reports and results. If you name the folder of one
    submission of a class, the whole class is judged. Then the gradebook and the overview are
    updated too, and the old results are kept.
    """
    batch = Ledger.around(path) if path.is_dir() else None
    if batch is not None:
        _class(batch, assignment, quiet, write=not dry_run)
    else:
        _one(path, assignment, write=not dry_run)


def _one(path: Path, assignment: str | None, *, write: bool) -> None:
    found = find_recordings(path)
    loaded = load_assignment(assignment or found.assignment_folder("regrade", str(path)))
    # One recording says nothing of the checks of other scenarios.
    before = found.result if path.is_dir() else None
    if before is not None:
        refuse_other(found.folder, before.assignment.id, loaded)
    clock = Clock()
    graded = judge_again(loaded, found)
    say(f"Assignment: {loaded.file}")
    result = make_result(graded.grade, graded.recordings, RunFacts(clock.started, clock.elapsed_s))
    print_grade(output_console(), loaded.assignment.title, result)
    if before is not None:
        for line in compare(before, graded.grade) or ["no check changed"]:
            say(line)
        if not write:
            say(NOTHING_WRITTEN)
        else:
            history = partial(with_history, found.folder)
            write_graded(graded, found.folder, clock, amended=history)
            say(f"Report: {found.folder / REPORT_FILE}")
    raise typer.Exit(exit_code(graded.grade))


def _class(batch: Ledger, assignment: str | None, quiet: bool, *, write: bool) -> None:
    began_s = time.monotonic()
    rows = []
    with batch.opened() as ledger:
        loaded = load_used(ledger, assignment)
        say(f"Assignment: {loaded.file}")
        with Progress(quiet).shown() as progress:
            progress.begin("judging", len(ledger.read().entries))
            for row in regrade_class(loaded, ledger, write=write):
                rows.append(row)
                progress.advance(row.done.entry.key)
        for row in rows:
            for change in row.changes:
                say(f"{row.done.entry.key}: {change}")
            if row.problem:
                say(f"{row.done.entry.key}: not judged again: {row.problem}")
        if write:
            say(f"Overview: {write_regraded(rows, ledger)}")
            say(f"Grades: {ledger.out / GRADES_FILE}")
        else:
            say(NOTHING_WRITTEN)
    gains = [row.gained for row in rows if row.gained > 0]
    losses = [-row.gained for row in rows if row.gained < 0]
    judged = [row for row in rows if row.done.fresh]
    changed = [row for row in rows if row.changes]
    say(
        f"{len(judged)} judged again in {time.monotonic() - began_s:.1f} s: {len(gains)} gain "
        f"{sum(gains):g} points, {len(losses)} lose {sum(losses):g} points, "
        f"{len(changed)} with a change"
    )
    left = [row for row in rows if row.problem or _is_not_graded(row)]
    if left:
        say(
            f"{len(left)} cannot be judged again from their recordings; run them again with "
            "`rosgrade batch ... --retry NAME`"
        )
    rows_now = class_rows([row.done for row in rows])
    raise typer.Exit(NOT_GRADED if any(row.cannot_be_graded for row in rows_now) or left else 0)


def _is_not_graded(row: Regraded) -> bool:
    return row.done.result is not None and not row.done.result.graded
