"""``rosgrade selftest``: the mutation score of assignments."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grader.cli.options import Quiet, SandboxChoice, chosen_sandbox
from grader.cli.screen.console import output_console, say
from grader.cli.screen.progress import Progress
from grader.resources import cache_folder
from grader.sandbox.choice import Choice

if TYPE_CHECKING:
    from rich.console import Console

    from grader.assignment.load import LoadedAssignment
    from grader.batch.grading import Graded
    from grader.batch.selftest import TrialResult


def selftest(
    assignments: Annotated[
        list[str] | None, typer.Argument(help="Ids or folders; by default all.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Submissions at once; by default two for each CPU.")
    ] = None,
    cpp: Annotated[
        bool, typer.Option("--cpp", help="Use the reference in C++ and mutants_cpp.yaml.")
    ] = False,
    record: Annotated[
        bool,
        typer.Option("--record", help="Grade only the reference; keep its recordings for reports."),
    ] = False,
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
    from grader import ros
    from grader.assignment.load import list_assignments, load_assignment
    from grader.assignment.mutant import CPP, PYTHON, reference_of
    from grader.batch.grading import Grading
    from grader.batch.reference_run import keep_reference
    from grader.batch.selftest import Role, Trial, mutation_score, trials
    from grader.batch.selftest import selftest as run_selftest
    from grader.errors import UsageError
    from grader.report.files import refuse_part
    from grader.run.host.load import cpu_count
    from grader.run.runner import Runner
    from grader.submission.underlay.definition import find_underlay
    from grader.submission.underlay.store import UnderlayStore

    if cpp and record:
        raise UsageError(
            "--record keeps the recordings of the reference in Python: leave out --cpp"
        )
    language = CPP if cpp else PYTHON
    if cpp:
        UnderlayStore(cache_folder(), ros.find()).fetched([find_underlay("rclcpp")])
    kept: list[str] = []

    def keep_runs(loaded: LoadedAssignment, graded: Graded) -> None:
        kept.append(keep_reference(loaded, graded.grade, graded.recordings))

    def chosen_trial(trial: Trial) -> bool:
        return not record or trial.role is Role.REFERENCE

    console = output_console()
    perfect = True
    chosen = chosen_sandbox(sandbox, Progress(quiet))
    for name in assignments or list_assignments():
        loaded = load_assignment(name)
        if keep is not None:
            refuse_part(keep, loaded.folder, f"the assignment in {loaded.folder}")
            reference = reference_of(loaded.assignment.id, loaded.folder, language)
            refuse_part(keep, reference, f"the reference solution in {reference}")
        results: list[TrialResult] = []
        wanted = sum(chosen_trial(trial) for trial in trials(loaded, language))
        with Runner(ros.find(), sandbox=chosen) as runner, Progress(quiet).shown() as progress:
            grading = Grading(loaded, runner, cache_folder())
            for result in run_selftest(
                loaded,
                grading,
                jobs=jobs or 2 * cpu_count(),
                language=language,
                keep=keep and keep / loaded.assignment.id,
                chosen=chosen_trial,
                on_graded=partial(keep_runs, loaded) if record else lambda _: None,
            ):
                results.append(result)
                progress.say(
                    f"{loaded.assignment.id}: {len(results)} of {wanted} graded: "
                    f"{result.trial.id}: {'WRONG' if result.wrong else 'ok'}"
                )
        if record:
            say(kept[-1])
            continue
        score = mutation_score(results)
        perfect = perfect and score.perfect
        percent = 100.0 * score.killed / score.mutants if score.mutants else 0.0
        _print(console, loaded.assignment.id, results)
        say(
            f"{loaded.assignment.id}: {score.accepted} of {score.right} right solutions with "
            f"full points, {score.killed} of {score.mutants} mutants judged as expected: "
            f"mutation score {percent:.0f} %"
        )
    raise typer.Exit(0 if perfect else 1)


def _print(console: Console, assignment: str, results: list[TrialResult]) -> None:
    from rich.markup import escape
    from rich.table import Table

    table = Table("", assignment, "WHAT", "LOST", box=None, pad_edge=False)
    order = ("reference", "variant", "mutant", "starter")
    for result in sorted(results, key=lambda r: (order.index(r.trial.role.value), r.trial.id)):
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
