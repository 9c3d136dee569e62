"""``rosgrade selftest``: the mutation score of assignments."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from grader.assignment.load import list_assignments, load_assignment
from grader.assignment.reference import CPP, PYTHON, reference_of
from grader.authoring.mutants.selftest import (
    Role,
    Setup,
    Trial,
    TrialResult,
    mutation_score,
    trials,
)
from grader.authoring.mutants.selftest import selftest as run_selftest
from grader.cli.options import Quiet, SandboxChoice, chosen_sandbox
from grader.cli.screen.console import output_console, say
from grader.cli.screen.progress import Progress
from grader.errors import UsageError
from grader.grading.graded import Graded
from grader.grading.grading import Grading
from grader.grading.reference_run import keep_reference
from grader.grading.type_support import wanted_underlays
from grader.machine import ros
from grader.machine.load import cpu_count
from grader.machine.resources import cache_folder
from grader.report.files import refuse_part
from grader.run.runner import Runner
from grader.sandbox.choice import Choice
from grader.spec.nearest_name import nearest_or_all
from grader.submission.underlay.store import UnderlayStore


def selftest(
    assignments: Annotated[
        list[str] | None, typer.Argument(help="Ids or folders; by default all.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Submissions at once; by default two for each CPU.")
    ] = None,
    cpp: Annotated[bool, typer.Option("--cpp", help="Use the reference in C++.")] = False,
    record: Annotated[
        bool,
        typer.Option("--record", help="Grade only the reference; keep its recordings for reports."),
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only", metavar="MUTANT", help="Grade only this mutant or variant; may be repeated."
        ),
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder for submissions that were judged wrongly, and their recordings.",
        ),
    ] = None,
    sandbox: SandboxChoice = Choice.AUTO,
    quiet: Quiet = False,
) -> None:
    """Grade the reference, variants and mutants of an assignment.

    The reference and every variant must get full points. Every mutant must lose exactly the
    checks that it names. The unchanged starter package must get at most 15 % of the points. Ends
    with 0 only if all of this is true.
    """
    if cpp and record:
        raise UsageError(
            "--record keeps the recordings of the reference in Python: leave out --cpp"
        )
    language = CPP if cpp else PYTHON
    place = chosen_sandbox(sandbox, Progress(quiet))
    perfect = True
    for name in assignments or list_assignments():
        loaded = load_assignment(name)
        reference = reference_of(loaded.assignment.id, loaded.folder, language)
        UnderlayStore(cache_folder(), ros.find()).fetched(wanted_underlays(loaded, reference))
        if keep is not None:
            refuse_part(keep, loaded.folder, f"the assignment in {loaded.folder}")
            refuse_part(keep, reference, f"the reference solution in {reference}")
        every = trials(loaded, language)
        _refuse_unknown(loaded.assignment.id, only or (), [trial.id for trial in every])
        if record:
            chosen = [trial for trial in every if trial.role is Role.REFERENCE]
        else:
            chosen = [trial for trial in every if not only or trial.id in only]
        graded: list[Graded] = []
        on_graded = graded.append if record else lambda _: None
        with Runner(ros.find(), sandbox=place) as runner:
            grading = Grading(loaded, runner, cache_folder())
            setup = Setup(loaded, grading, reference, language, on_graded)
            results = _graded(setup, chosen, jobs, keep, Progress(quiet))
        if record:
            say(keep_reference(loaded, graded[0].grade, graded[0].recordings))
        else:
            perfect = _say_score(loaded.assignment.id, results) and perfect
    raise typer.Exit(0 if perfect else 1)


def _graded(
    setup: Setup, chosen: Sequence[Trial], jobs: int | None, keep: Path | None, progress: Progress
) -> list[TrialResult]:
    """Grade the chosen trials of an assignment, and say how each went."""
    name = setup.loaded.assignment.id
    results: list[TrialResult] = []
    with progress.shown():
        kept_in = keep and keep / name
        for result in run_selftest(setup, chosen, jobs=jobs or 2 * cpu_count(), keep=kept_in):
            results.append(result)
            progress.say(
                f"{name}: {len(results)} of {len(chosen)} graded: "
                f"{result.trial.id}: {'WRONG' if result.wrong else 'ok'}"
            )
    return results


def _say_score(assignment: str, results: list[TrialResult]) -> bool:
    """Print the results of an assignment; whether every trial ended as it must."""
    score = mutation_score(results)
    _print(output_console(), assignment, results)
    say(f"{assignment}: {score.words}")
    return score.perfect


def _refuse_unknown(assignment: str, only: Sequence[str], ids: Sequence[str]) -> None:
    unknown = sorted({*only}.difference(ids))
    if unknown:
        near = nearest_or_all(unknown[0], ids)
        raise UsageError(f"{assignment} has no mutant {unknown[0]!r}.{near}")


def _print(console: Console, assignment: str, results: list[TrialResult]) -> None:
    table = Table("", assignment, "WHAT", "LOST", box=None, pad_edge=False)
    order = [Role.REFERENCE, Role.VARIANT, Role.MUTANT, Role.STARTER]
    for result in sorted(results, key=lambda r: (order.index(r.trial.role), r.trial.id)):
        table.add_row(
            "WRONG" if result.wrong else "ok",
            result.trial.id,
            escape(result.trial.title),
            escape(result.mistake or ", ".join(result.lost) or "nothing"),
        )
    console.print(table)
    for result in results:
        for line in result.findings:
            say(f"{result.trial.id}: {line}")
