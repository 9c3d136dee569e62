"""``rosgrade check``: grade one submission."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grader.cli import NOT_GRADED, options
from grader.cli.formats import CheckFormats, with_formats
from grader.cli.screen.console import open_page, output_console, say
from grader.cli.screen.progress import Progress, syntax_errors
from grader.machine.resources import cache_folder
from grader.sandbox.choice import Choice

if TYPE_CHECKING:
    from grader.recording.model import Recording
    from grader.recording.submission import SubmissionRecord


@with_formats
def check(
    assignment: options.AssignmentName,
    submission: Annotated[
        Path, typer.Argument(help="The submission: a folder, a .zip or a .tar.gz.")
    ] = Path(),
    *,
    report: options.ReportFolder = None,
    json_file: Annotated[
        Path | None, options.file_option("--json", text="Also write the result to this file.")
    ] = None,
    scenario: options.Scenarios = None,
    only: options.Checks = None,
    seed: options.Seed = None,
    chosen: options.Chosen = None,
    hidden: options.Hidden = False,
    formats: CheckFormats,
    sandbox: options.SandboxChoice = Choice.AUTO,
    keep: Annotated[
        bool,
        typer.Option("--keep", help="Keep colcon's install space in the report's folder."),
    ] = False,
    quiet: options.Quiet = False,
    verbose: options.Verbose = False,
    open_report: Annotated[
        bool, typer.Option("--open", help="Open the report in a browser.")
    ] = False,
) -> None:
    """Grade one submission: build, run, judge the recording.

    Ends with 0 for full points, 1 if points were lost, 3 if it could not be graded.
    """
    from grader.machine import ros
    from grader.report.files import refuse_inputs
    from grader.report.model.facts import Clock
    from grader.run.runner import Runner

    clock = Clock()
    report = options.report_folder(report, assignment)
    page = report / "report.html"
    refuse_inputs(
        (report, page, json_file, *formats.files.values()),
        (*options.assignment_places(assignment), submission, formats.gradescope_metadata),
    )
    with formats.grading():
        progress = Progress(quiet, verbose)
        runner = Runner(
            ros.find(),
            progress=_while_it_starts(progress.narrate),
            sandbox=options.chosen_sandbox(sandbox, progress),
            verbose=verbose,
        )
        runner.get_ready()
        try:
            # Imported while the cell gets ready.
            from grader.grading.files import claim
            from grader.grading.grading import Grading, Told
            from grader.grading.spine import HandedIn, grade
            from grader.report.files import check_folder
            from grader.submission.intake.locate import check_path
            from grader.submission.kept_source import SOURCE_FOLDER, read_source

            loaded = options.graded_part(assignment, chosen, only, scenario, hidden=hidden)
            check_path(submission)
            check_folder(report)
            claim(report, keep=keep)

            def tell(record: SubmissionRecord, _: Mapping[str, Recording]) -> None:
                for text in syntax_errors(record, submission):
                    progress.tell(text)

            told = Told(progress.say, partial(progress.output, "build"), tell)
            grading = Grading(loaded, runner, cache_folder(), seed=seed, told=told)
            with progress.shown():
                graded = grade(HandedIn(submission, report), grading)
            from grader.grading.attempts import with_history
            from grader.grading.files import keep_install, write_graded
            from grader.report.text.terminal import print_grade

        except KeyboardInterrupt:
            progress.say("interrupted: ending what still runs; no report is written")
            raise
        finally:
            runner.close()
        from grader.submission.underlay.ros2_command import absence_note

        history = partial(with_history, report)
        result = write_graded(graded, report, clock, json_file, history, submission)
        console, source = output_console(), read_source(report / SOURCE_FOLDER).files
        print_grade(console, graded.grade.assignment.title, result, source)
        say(f"Report: {page}")
        note = absence_note(" ".join(f"{one.hint} {one.author_hint}" for one in result.checks))
        if note:
            say(note)
        if keep:
            say(f"Installed: {keep_install(graded, report)}")
    formats.write(result, submission)
    if open_report:
        open_page(page.resolve().as_uri())
    status = options.exit_code(graded.grade)
    raise typer.Exit(0 if formats.classroom50 and status != NOT_GRADED else status)


Narrate = Callable[[str, Mapping[str, Any]], None]


def _while_it_starts(narrate: Narrate) -> Narrate:
    """Import what is needed after a run while the student's node starts.

    A node takes a CPU for a third of a second to start, and the command has nothing else to do.
    """
    begun = threading.Event()

    def tell(scenario: str, event: Mapping[str, Any]) -> None:
        narrate(scenario, event)
        if event["event"] == "launching" and not begun.is_set():
            begun.set()
            threading.Thread(target=_get_ready, name="ahead", daemon=True).start()

    return tell


def _get_ready() -> None:
    for module in ("grader.grading.attempts", "grader.report.text.terminal", "rich.syntax"):
        import_module(module)
    from grader.recording import mcap_reader
    from grader.report.html import page

    mcap_reader.get_ready()
    page.environment()
