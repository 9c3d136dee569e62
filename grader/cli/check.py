"""``rosgrade check``: grade one submission."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grader.cli.console import Progress, cache_folder, output_console

if TYPE_CHECKING:
    from collections.abc import Mapping

FULL_POINTS, POINTS_LOST, NOT_GRADED = 0, 1, 3


def check(
    assignment: Annotated[str, typer.Argument(help="Id of the assignment, or its folder.")],
    submission: Annotated[
        Path, typer.Argument(help="What was handed in: a folder, a .zip or a .tar.gz.")
    ],
    report: Annotated[
        Path, typer.Option(help="Folder for report.html, result.json and the recordings.")
    ] = Path("rosgrade-report"),
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Write the result here as well.")
    ] = None,
    scenario: Annotated[
        list[str] | None, typer.Option(help="Run only this scenario; may be repeated.")
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Judge only this check and what it requires; may be repeated."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of all random values; by default the submission's.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
    open_report: Annotated[
        bool, typer.Option("--open", help="Open the report in a browser.")
    ] = False,
) -> None:
    """Grade one submission: build it, run its nodes, judge what was recorded.

    Ends with 0 for full points, 1 if points were lost, 3 if it could not be graded.
    """
    from grader import ros
    from grader.report.facts import Clock
    from grader.run.runner import Runner

    clock = Clock()
    progress = Progress(quiet)
    runner = Runner(ros.find(), progress=_narrator(progress))
    runner.get_ready()
    try:
        # Imported while the cell gets ready.
        from grader.assignment.load import load_assignment
        from grader.assignment.selection import select
        from grader.batch.files import write_graded
        from grader.batch.grading import RECORDINGS_FOLDER, Grading
        from grader.report.terminal import print_grade
        from grader.submission.locate import check_path

        loaded = select(load_assignment(assignment), tuple(only or ()), tuple(scenario or ()))
        check_path(submission)
        grading = Grading(loaded, runner, cache_folder(), seed=seed)
        with progress.shown():
            progress.say(f"reading {submission}")
            graded = grading.grade(submission, report / RECORDINGS_FOLDER, progress.say)
    finally:
        runner.abort()
    written = write_graded(graded, report, clock, json_file)
    console = output_console()
    print_grade(console, graded.grade)
    console.print(f"Report: {written}", soft_wrap=True)
    if open_report:
        typer.launch(written.resolve().as_uri())
    grade = graded.grade
    status = FULL_POINTS if grade.full_points else POINTS_LOST
    raise typer.Exit(status if grade.graded else NOT_GRADED)


def _narrator(progress: Progress) -> Any:
    """Tell what a cell does in a student's words."""

    def narrate(scenario: str, event: Mapping[str, Any]) -> None:
        kind = event["event"]
        if kind == "launching":
            progress.say(f"{scenario}: starting {event['process']}")
        elif kind == "waiting":
            progress.say(f"{scenario}: waiting for {event['what']}", passing=True)
        elif kind == "recording":
            progress.say(
                f"{scenario}: recording, {event['messages']} messages, "
                f"{event['elapsed_s']:.1f} of at most {event['limit_s']:.1f} s",
                passing=True,
            )
        elif kind == "stopping":
            progress.say(f"{scenario}: stopping", passing=True)

    return narrate
