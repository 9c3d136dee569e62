"""``rosgrade similar`` and ``rosgrade questions``: pages for the instructor only."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grader.cli.options import Quiet
from grader.cli.screen.console import say
from grader.cli.screen.progress import Progress

if TYPE_CHECKING:
    from grader.assignment.load import LoadedAssignment
    from grader.batch.ledger import Ledger

Out = Annotated[Path, typer.Argument(help="The folder of a class that was graded.")]
Named = Annotated[
    str | None,
    typer.Argument(
        metavar="[ASSIGNMENT]", help="Id or folder; by default the one used for grading."
    ),
]


def similar(out: Out, assignment: Named = None) -> None:
    """List the submissions of a class that are alike, side by side. Nothing is run.

    Finds copies that were renamed, reordered and reformatted. The page is for the instructor only.
    """
    from grader.batch.instructor import write_similarity
    from grader.findings.wording import counted

    file, found = write_similarity(*_class(out, assignment, "similar"))
    say(f"{counted(found, 'pair')} of submissions that are alike: {file}")


def questions(out: Out, assignment: Named = None, quiet: Quiet = False) -> None:
    """Write three questions for an oral exam of each student. Nothing is run.

    They are made by rules from the recordings and the source. The page is for the instructor only.
    """
    from grader.batch.instructor import write_questions
    from grader.findings.wording import counted

    loaded, ledger = _class(out, assignment, "questions")
    with Progress(quiet).shown() as progress:
        progress.begin("reading", len(ledger.read().entries))
        file, found = write_questions(loaded, ledger, progress.advance)
    say(f"Questions about {counted(found, 'submission')}: {file}")


def _class(out: Path, assignment: str | None, command: str) -> tuple[LoadedAssignment, Ledger]:
    from grader.assignment.load import load_assignment
    from grader.batch.ledger import Ledger
    from grader.batch.regrading import stored_assignment

    ledger = Ledger(out)
    rows = ledger.read()
    name = assignment or stored_assignment(out, rows.assignment, rows.location, command, str(out))
    return load_assignment(name), ledger
