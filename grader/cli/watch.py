"""``rosgrade watch``: grade again at every saved change."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from grader.assignment.load import LoadedAssignment
from grader.cli import options
from grader.cli.option_group import with_option_groups
from grader.cli.screen.console import open_page, output_console, print_error, say
from grader.cli.screen.progress import Progress, syntax_errors
from grader.errors import RosgradeError
from grader.findings.finding import Status
from grader.grade.early import judge_early
from grader.grading.attempts import with_history
from grader.grading.files import claim, write_graded
from grader.grading.graded import Graded
from grader.grading.grading import Grading, Told
from grader.grading.spine import HandedIn, grade
from grader.grading.watching import Ended, Step, Watching
from grader.machine import ros
from grader.machine.resources import cache_folder
from grader.recording.model import Recording
from grader.recording.submission import SubmissionRecord
from grader.report.files import check_folder, refuse_inputs
from grader.report.model.facts import Clock
from grader.report.model.result_model import Result
from grader.report.text.explanation import score
from grader.report.text.last_save import early_line, failed_scenarios, what_changed
from grader.report.text.terminal import print_changes, print_grade
from grader.run.runner import Runner
from grader.sandbox.choice import Choice
from grader.server.watch import ReportPage
from grader.submission.intake.locate import check_path
from grader.submission.kept_source import SOURCE_FOLDER, read_kept_source


@with_option_groups
def watch(
    assignment: options.AssignmentName,
    submission: Annotated[
        Path, typer.Argument(help="Your package, workspace, or its src.")
    ] = Path(),
    *,
    report: options.ReportFolder = None,
    part: options.Part,
    sandbox: options.SandboxChoice = Choice.AUTO,
    port: options.Port = 0,
    quiet: options.Quiet = False,
    verbose: options.Verbose = False,
    open_report: Annotated[
        bool, typer.Option("--open", help="Open the report page in a browser.")
    ] = False,
) -> None:
    """Grade now, and again after every save, until Ctrl-C.

    First runs the checks that failed last time, and shows at once how they end now. Shows what
    changed since the last grade. The report page updates itself. A save during a run starts the run
    again. The files of the assignment are watched too.
    """
    report = options.report_folder(report, assignment)
    outputs = [report, report / "report.html"]
    refuse_inputs(outputs, [*options.assignment_places(assignment), submission])
    loaded = part.of(assignment)
    check_path(submission)
    check_folder(report)
    claim(report, keep=False)
    with ExitStack() as stack:
        page = ReportPage(report / "report.html", port)
        stack.callback(page.close)
        progress = Progress(quiet, verbose, page.show_phase)
        place = options.chosen_sandbox(sandbox, progress)
        runner = Runner(ros.find(), progress=progress.narrate, sandbox=place, verbose=verbose)
        work = _Work(assignment, part, loaded, submission, report, progress, runner, page)
        stack.callback(work.close)
        console = output_console()
        say(f"Report page: {page.url}")
        if open_report:
            open_page(page.door(report), page.url)
        try:
            _follow(work, page, console)
        except KeyboardInterrupt:
            console.print("\nNo longer watching.")


@dataclass
class _Work:
    """Grades the submission, each time with the warm processes of the time before."""

    assignment: str
    part: options.Part
    loaded: LoadedAssignment
    submission: Path
    report: Path
    progress: Progress
    runner: Runner
    page: ReportPage
    grading: Grading | None = None
    problem: RosgradeError | None = None
    before: Result | None = None

    def begin(self) -> None:
        self.runner.get_ready()
        try:
            self.loaded, self.problem = self.part.of(self.assignment), None
        except RosgradeError as error:
            # Shown as the end of the grading: the student corrects it and saves again.
            self.problem = error
        self.grading = Grading(
            self.loaded,
            self.runner,
            cache_folder(),
            seed=self.part.seed,
            first=failed_scenarios(self.before) if self.before is not None else (),
            told=Told(self.progress.say, partial(self.progress.output, "build"), self.tell_early),
        )

    def grade(self) -> Graded:
        assert self.grading is not None
        if self.problem is not None:
            raise self.problem
        self.progress.say(f"reading {self.submission}")
        return grade(HandedIn(self.submission, self.report), self.grading)

    def tell_early(self, record: SubmissionRecord, recordings: Mapping[str, Recording]) -> None:
        """Tell what is certain already: lines that Python cannot read, and what failed last."""
        known = syntax_errors(record, self.submission)
        if (
            record.build
            and self.before is not None
            and len(recordings) < len(self.loaded.assignment.scenarios)
        ):
            failed = {check.id for check in self.before.of(Status.FAILED)}
            judged = judge_early(self.loaded, record, recordings, failed)
            known += map(early_line, judged)
        for text in known:
            if text not in self.page.state.early:
                self.progress.tell(text)
                self.page.show(early=(*self.page.state.early, text))

    def amended(self, result: Result) -> Result:
        """A result with earlier attempts, and hints that are counted if the author wants it."""
        result = with_history(self.report, result)
        counts = (result.hints_opened or {}) if self.loaded.assignment.count_hints else None
        return result.model_copy(update={"hints_opened": counts})

    def cancel(self) -> None:
        assert self.grading is not None
        self.runner = self.grading.cancel()

    def close(self) -> None:
        self.runner.close()


def _follow(work: _Work, page: ReportPage, console: Console) -> None:
    clock = Clock()
    with ExitStack() as shown:
        watching = Watching(work.submission, work.report, work, work.loaded.folder)
        for event in watching.events():
            title = work.loaded.assignment.title
            if event is Step.BEGAN:
                clock = Clock()
                page.begin(f"… {title}")
                shown.enter_context(work.progress.shown())
                continue
            shown.close()
            if not isinstance(event, Ended):
                work.progress.say("saved again: starting over")
                continue
            if event.graded is None:
                print_error(str(event.problem))
                page.show(text=f"not graded: {event.problem}", title=f"! {title}", is_old=False)
            else:
                with page.writing:
                    result = write_graded(
                        event.graded, work.report, clock, amended=work.amended, root=work.submission
                    )
                source = read_kept_source(work.report / SOURCE_FOLDER).files
                console.rule(f"{time.strftime('%H:%M:%S')}, after {clock.elapsed_s:.1f} s")
                points = score(result)
                changed = what_changed(work.before, result) if work.before is not None else ""
                page.show_grade(
                    f"{points}, graded at {time.strftime('%H:%M:%S')}",
                    f"{points}: {title}",
                    changed,
                    (result.known_score, result.known_max_score),
                )
                page.show_hints(result)
                if work.before is None:
                    print_grade(console, title, result, source)
                else:
                    print_changes(console, work.before, result, page.state.scores, source)
                work.before = result
                work.runner.get_ready()
            work.progress.say(f"watching {work.submission}; Ctrl-C ends")
