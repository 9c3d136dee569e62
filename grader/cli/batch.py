"""``rosgrade batch``: grade a class."""

from __future__ import annotations

import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, nullcontext
from pathlib import Path
from statistics import median
from typing import Annotated

import typer

from grader.assignment.load import load_assignment
from grader.batch import executor as executors
from grader.batch.batch import Batch, Done
from grader.batch.collected import Collected
from grader.batch.groups import unknown_students
from grader.batch.intake import collect, collect_roster
from grader.batch.ledger import Ledger, TakenFrom
from grader.batch.roster import read_roster
from grader.batch.used_assignment import in_use, load_used
from grader.batch.worker import Order, make_grading
from grader.cli import NOT_GRADED
from grader.cli.options import Quiet, SandboxChoice, Seed, assignment_argument, assignment_places
from grader.cli.screen.console import output_console, say
from grader.cli.screen.progress import Progress
from grader.course.load import Course
from grader.errors import UsageError
from grader.gradebook.adjusting import ClassAdjustments, course_of
from grader.gradebook.class_files import GRADES_FILE, all_standing, class_rows, copies, write_class
from grader.gradebook.class_regrading import bring_up_to_date
from grader.machine.scratch import Scratch
from grader.report.files import check_folder, refuse_inputs, refuse_part
from grader.report.model.class_row import RowStatus
from grader.run.admission import Admission
from grader.sandbox.choice import Choice

_AUTO = "auto"


def batch(
    context: typer.Context,
    assignment: Annotated[
        str,
        typer.Argument(
            metavar="ASSIGNMENT",
            help="Id of the assignment, or its folder. Or OUT, to continue with a class.",
            callback=lambda name: name if is_batch(name) else assignment_argument(name),
        ),
    ],
    submissions: Annotated[
        Path | None,
        typer.Argument(
            help="A folder of submissions (folders, archives or clones; also from Canvas or "
            "Gradescope), an archive of it, or a roster (.csv) with a column `submission`."
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for all results.")] = None,
    jobs: Annotated[
        str, typer.Option(help="Submissions at once; auto adapts to the load of the machine.")
    ] = _AUTO,
    roster: Annotated[Path | None, typer.Option(help="CSV with all students of the class.")] = None,
    course: Annotated[
        Path | None,
        typer.Option(help="YAML with the rules of the course: due dates, lateness, attempts."),
    ] = None,
    retry: Annotated[
        list[str] | None,
        typer.Option(help="Grade this submission again, or `errors`, or `all`. May be repeated."),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, such as tcp://host:8786.")
    ] = None,
    seed: Seed = None,
    sandbox: SandboxChoice = Choice.AUTO,
    quiet: Quiet = False,
) -> None:
    """Grade a class. `rosgrade batch OUT` continues where it stopped, also with new submissions.

    Writes a report for each submission, an overview (index.html) and grades.csv to OUT. Ends
    with 0 if every submission was graded, with good or bad grades, and with 3 if one was not.
    """
    at_once = _at_once(jobs)
    if context.args:
        # What a shell makes of `class/*`.
        count = 1 + len(context.args)
        raise UsageError(f"batch takes one folder, not {count} submissions: give their folder")
    again = is_batch(assignment)
    if again:
        out = Path(assignment)
        submissions, roster, seed = _as_before(out, submissions, roster, seed)
        loaded = load_used(Ledger(out))
    else:
        loaded = load_assignment(assignment)
    if submissions is None or out is None:
        raise UsageError("name the submissions and a folder for the results, SUBMISSIONS --out OUT")
    places = [] if again else assignment_places(assignment)
    refuse_inputs([out], [*places, submissions, roster, course])
    check_folder(out)
    named, loaded = loaded, in_use(Ledger(out), loaded)
    refuse_part(out, loaded.folder, f"the assignment in {loaded.folder}")
    rules = course_of(out, course, loaded.assignment.id)
    order = Order(str(loaded.folder.resolve()), loaded.sha256, seed, sandbox)
    admission = Admission(cells=at_once)
    # Before anything is read or written: without a sandbox there is no batch.
    grading = make_grading(order, loaded, admission) if scheduler is None else None

    def executor() -> executors.BatchExecutor:
        if grading is None:
            return executors.DaskExecutor(str(scheduler), order)
        return executors.LocalExecutor(grading, admission.most)

    began_s = time.monotonic()
    with Scratch("batch") as staging, Progress(quiet).shown() as progress:
        if grading is not None and not quiet:
            for line in grading.surroundings:
                progress.note(line)
        if again or loaded is not named:
            progress.note(f"graded with {loaded.file}, as the class is")
        rows = _rows(submissions, roster, rules, out, staging, progress)
        with Ledger(out).opened() as ledger:
            rules_file = str(rules.file.resolve()) if rules is not None else None
            roster_file = str(roster.resolve()) if roster is not None else None
            taken = TakenFrom(str(submissions.resolve()), roster_file, seed)
            work = Batch(loaded, ledger, frozenset(retry or ()), rules_file, taken, keep=again)
            done = bring_up_to_date(_grade(work, rows, executor, progress), ledger)
            overview = write_class(done, ledger)
    console = output_console()
    console.print(_summary(done, time.monotonic() - began_s), soft_wrap=True)
    say(f"Overview: {overview}")
    say(f"Grades: {overview.with_name(GRADES_FILE)}")
    raise typer.Exit(NOT_GRADED if any(row.cannot_be_graded for row in class_rows(done)) else 0)


def _as_before(
    out: Path, submissions: Path | None, roster: Path | None, seed: int | None
) -> tuple[Path, Path | None, int | None]:
    """Submissions, roster and seed: those that are named now, else those of the batch before."""
    before = Ledger(out).read().taken_from
    if before is None:
        if submissions is None:
            raise UsageError(f"{out}: say where the submissions lie: rosgrade batch {out} FOLDER")
        return submissions, roster, seed
    if roster is None and before.roster:
        roster = Path(before.roster)
    return submissions or Path(before.submissions), roster, before.seed if seed is None else seed


def _grade(
    work: Batch,
    rows: list[Collected],
    make_executor: Callable[[], executors.BatchExecutor],
    progress: Progress,
) -> list[Done]:
    """Grade what is still to be graded; no executor is made where that is nothing."""
    ledger = work.ledger
    progress.begin("reading", len(rows))
    entries, to_do = work.read(rows, progress.advance)
    # What people wrote must be readable before anything is run.
    for key in ClassAdjustments(ledger).vanished():
        progress.note(f"the review of {key} stays, but the class has no such student")
    executor = make_executor() if to_do else None
    keys = [entry.key for entry in entries if entry.key not in to_do]
    graded_before = [key for key in keys if ledger.result(key) is not None]
    progress.begin("grading", len(entries), already=len(graded_before))
    with closing(executor) if executor is not None else nullcontext():
        return _graded(work, work.grade(to_do, executor), len(entries), progress)


def _rows(
    submissions: Path,
    roster: Path | None,
    rules: Course | None,
    out: Path,
    staging: Path,
    progress: Progress,
) -> list[Collected]:
    """Who handed in what, with what is strange about it told; nothing of it holds the results."""
    is_roster = submissions.suffix.lower() == ".csv" and submissions.is_file()
    roster_file = submissions if is_roster else roster
    students = read_roster(roster_file) if roster_file is not None else None
    if students is not None and is_roster:
        progress.begin("fetching", len(students.students))
        rows = collect_roster(students, submissions.parent, staging, progress.advance, rules)
    else:
        rows = collect(submissions, staging, students, progress.note, out, rules)
    if students is not None:
        for problem in students.problems:
            progress.note(f"{roster_file}: {problem}")
    if rules is not None:
        for line in unknown_students(rows, rules):
            progress.note(line)
    for row in rows:
        if row.path is not None:
            # Results within a submission would be a part of it.
            refuse_part(out, row.path, f"the submission of {row.key}")
    return rows


def _graded(work: Batch, finished: Iterator[Done], count: int, progress: Progress) -> list[Done]:
    """The rows of a class as they are finished; what is there at an interrupt is written."""
    done: list[Done] = []
    try:
        for row in finished:
            done.append(row)
            progress.advance(row.entry.key, _outcome(row), fresh=row.fresh)
    except (KeyboardInterrupt, executors.ExecutorLost):
        # A second Ctrl-C takes away nothing of what is written because of the first.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        ledger = work.ledger
        progress.note(
            f"interrupted; {len(done)} of {count} are in {ledger.out}. "
            f"`rosgrade batch {ledger.out}` grades the others"
        )
        write_class(bring_up_to_date(all_standing(ledger), ledger), ledger)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        raise
    return done


def is_batch(name: str) -> bool:
    """Whether a name is the folder of a batch."""
    return (Path(name) / "batch.json").is_file()


def _at_once(jobs: str) -> int | None:
    if jobs == _AUTO:
        return None
    if not (jobs.isdecimal() and int(jobs) > 0):
        raise UsageError(f"--jobs {jobs}: must be auto, or 1 or more")
    return int(jobs)


def _outcome(done: Done) -> str:
    if done.result is None:
        return done.entry.fault or done.entry.problem or "not graded"
    if done.result.submission.problem:
        return f"unreadable: {done.result.submission.problem}"
    if done.result.score is None:
        return "not graded"
    return f"{done.result.score:g} of {done.result.max_score:g} points"


def _summary(done: Sequence[Done], wall_s: float) -> str:
    rows = class_rows(done)
    scores = [row.score for row in rows if row.score is not None]
    count = Counter(row.status for row in rows)
    fresh = len([row for row in done if row.fresh])
    graded = len(scores) + count[RowStatus.WAITING]
    parts = [f"{graded} of {len(rows)} graded ({fresh} now, in {wall_s:.0f} s)"]
    if scores:
        most = max(row.result.final_max_score for row in rows if row.graded and row.result)
        parts.append(f"median {median(scores):g} of {most:g} points")
        parts.append(f"{sum(row.full for row in rows)} with full points")
    counts = {
        "wait for a person (rosgrade review)": count[RowStatus.WAITING],
        "the same as another": copies(done),
        "could not be graded (see --retry errors, and review)": count[RowStatus.NOT_GRADED],
        "unreadable, without a score": count[RowStatus.UNREADABLE],
        "handed in nothing": count[RowStatus.MISSING],
    }
    return "; ".join([*parts, *(f"{number} {what}" for what, number in counts.items() if number)])
