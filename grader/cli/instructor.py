"""``rosgrade similar`` and ``rosgrade questions``: pages for the instructor only."""

from __future__ import annotations

from grader.batch.ledger import Ledger
from grader.batch.used_assignment import load_used
from grader.cli.options import ClassFolder, Quiet, UsedAssignment
from grader.cli.screen.console import say
from grader.cli.screen.progress import Progress
from grader.findings.words import counted
from grader.gradebook.instructor import write_questions, write_similarity


def similar(out: ClassFolder, assignment: UsedAssignment = None) -> None:
    """List the submissions of a class that are alike, side by side. Nothing is run.

    Finds copies that were renamed, reordered and reformatted. The page is for the instructor only.
    """
    ledger = Ledger(out)
    file, found = write_similarity(load_used(ledger, assignment, "similar"), ledger)
    say(f"{counted(found, 'pair')} of submissions that are alike: {file}")


def questions(out: ClassFolder, assignment: UsedAssignment = None, quiet: Quiet = False) -> None:
    """Write three questions for an oral exam of each student. Nothing is run.

    They are made by rules from the recordings and the source. The page is for the instructor only.
    """
    ledger = Ledger(out)
    loaded = load_used(ledger, assignment, "questions")
    with Progress(quiet).shown() as progress:
        progress.begin("reading", len(ledger.read().entries))
        file, found = write_questions(loaded, ledger, progress.advance)
    say(f"Questions about {counted(found, 'submission')}: {file}")
