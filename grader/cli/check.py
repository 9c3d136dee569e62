"""``rosgrade check``: grade one submission."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grader.cli import NOT_GRADED, options
from grader.cli.formats import CheckFormats
from grader.cli.option_group import with_option_groups
from grader.cli.screen.console import open_page, output_console, say
from grader.cli.screen.progress import Progress, syntax_errors
from grader.machine import ros
from grader.machine.resources import cache_folder
from grader.report.files import check_folder, refuse_inputs
from grader.report.model.facts import Clock
from grader.run.runner import Runner
from grader.sandbox.choice import Choice

if TYPE_CHECKING:
    from grader.recording.model import Recording
    from grader.recording.submission import SubmissionRecord


@with_option_groups
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
    part: options.Part,
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
    clock = Clock()
    report = options.report_folder(report, assignment)
    page = report / "report.html"
    refuse_inputs(
        (report, page, json_file, *formats.files.values()),
        (*options.assignment_places(assignment), submission, formats.gradescope_metadata),
    )
    with formats.grading():
        progress = Progress(quiet, verbose)

        def narrate(scenario: str, event: Mapping[str, Any]) -> None:
            progress.narrate(scenario, event)
            if event["event"] == "launching":
                _get_ready_ahead()

        place = options.chosen_sandbox(sandbox, progress)
        runner = Runner(ros.find(), progress=narrate, sandbox=place, verbose=verbose)
        runner.get_ready()
        try:
            # Imported while the cell gets ready.
            from grader.grading.attempts import with_history
            from grader.grading.files import claim, keep_install, write_graded
            from grader.grading.grading import Grading, Told
            from grader.grading.spine import HandedIn, grade
            from grader.report.text.terminal import print_grade
            from grader.submission.intake.locate import check_path
            from grader.submission.kept_source import SOURCE_FOLDER, read_kept_source
            from grader.submission.underlay.ros2_command import absence_note

            loaded = part.of(assignment)
            check_path(submission)
            check_folder(report)
            claim(report, keep=keep)

            def tell(record: SubmissionRecord, _: Mapping[str, Recording]) -> None:
                for text in syntax_errors(record, submission):
                    progress.tell(text)

            told = Told(progress.say, partial(progress.output, "build"), tell)
            grading = Grading(loaded, runner, cache_folder(), seed=part.seed, told=told)
            with progress.shown():
                graded = grade(HandedIn(submission, report), grading)
        except KeyboardInterrupt:
            progress.say("interrupted: ending what still runs; no report is written")
            raise
        finally:
            runner.close()
        history = partial(with_history, report)
        result = write_graded(graded, report, clock, json_file, history, submission)
        console, source = output_console(), read_kept_source(report / SOURCE_FOLDER).files
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


@cache
def _get_ready_ahead() -> None:
    """Make what is needed after a run while the student's node starts.

    A node takes a CPU for a third of a second to start, and the command has nothing else to do.
    """

    def get_ready() -> None:
        import_module("rich.syntax")
        mcap_reader.get_ready()
        environment()

    from grader.recording import mcap_reader
    from grader.report.html.page import environment

    threading.Thread(target=get_ready, name="ahead", daemon=True).start()
