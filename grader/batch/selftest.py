"""The mutation score of an assignment: does it tell right from wrong?

The reference and every variant (a right solution in another style) must get full points; every
mutant must lose exactly the checks that it names; the starter package, untouched, must get
almost nothing.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.assignment.mutant import (
    Change,
    Difference,
    Mutant,
    MutantVerdict,
    apply,
    expected_statuses,
    load_mutants,
    verdict,
)
from grader.batch.grading import Graded, Grading
from grader.checks.finding import Status
from grader.grade.model import Grade
from grader.report.model.facts import RunFacts
from grader.report.model.grade_part import grade_json
from grader.report.model.result import make_result
from grader.report.text.words import counted_points, number
from grader.scratch import Scratch
from grader.spec.unit import format_duration
from grader.starter import write_starter

REFERENCE = "reference"
STARTER = "starter"
MOST_FOR_STARTER = 0.15
"""Share of the points that the starter package may get before anything was written in it."""


class Role(str, Enum):
    """What a trial is."""

    REFERENCE = "reference"
    VARIANT = "variant"
    MUTANT = "mutant"
    STARTER = "starter"


@dataclass(frozen=True)
class Trial:
    """One submission to grade, with the outcome that it must have."""

    role: Role
    id: str
    title: str
    change: Change | None


@dataclass(frozen=True)
class TrialResult:
    """How a trial went, without its recordings: an assignment has a hundred trials and more."""

    trial: Trial
    verdict: MutantVerdict
    lost: tuple[str, ...]
    graded: bool
    repeated: bool
    grade: str
    told: tuple[str, ...] = ()


def trials(loaded: LoadedAssignment, reference: Path | None = None) -> tuple[Trial, ...]:
    """The trials of an assignment: its reference, its variants, its mutants, its starter."""
    mutants = load_mutants(loaded.assignment, loaded.folder, reference)
    changes = [*mutants.variants, *mutants.mutants]
    return (
        Trial(Role.REFERENCE, REFERENCE, "the reference solution", None),
        *(
            Trial(
                Role.MUTANT if isinstance(change, Mutant) else Role.VARIANT,
                change.id,
                change.title,
                change,
            )
            for change in changes
            if not change.skip_reason
        ),
        Trial(Role.STARTER, STARTER, "the starter package, untouched", None),
    )


def write_submission(trial: Trial, loaded: LoadedAssignment, reference: Path, folder: Path) -> Path:
    """Make the submission of a trial."""
    if trial.role is Role.STARTER:
        write_starter(loaded, folder / trial.id)
        return folder / trial.id
    if trial.change is None:
        return reference
    target = folder / trial.id
    apply(trial.change, reference, target)
    return target


def run_trial(
    trial: Trial,
    loaded: LoadedAssignment,
    grading: Grading,
    reference: Path,
    folder: Path,
    on_graded: Callable[[Graded], None] = lambda _: None,
) -> TrialResult:
    """Grade one trial."""
    submission = write_submission(trial, loaded, reference, folder / "submissions")
    graded = grading.grade(submission, folder / "recordings" / trial.id)
    on_graded(graded)
    actual = {result.id: result.status for result in graded.grade.results}
    if trial.role is Role.STARTER:
        outcome = _starter_verdict(graded.grade)
    elif trial.change is None:
        outcome = verdict(dict.fromkeys(actual, Status.PASSED), actual)
    else:
        put_right = [result.id for result in graded.grade.results if result.put_right]
        outcome = verdict(expected_statuses(loaded.assignment, trial.change, put_right), actual)
    return TrialResult(
        trial=trial,
        verdict=outcome,
        lost=tuple(name for name, status in actual.items() if status is Status.FAILED),
        graded=graded.grade.graded,
        repeated=any(count > 1 for count in graded.runs.values()),
        grade=grade_json(make_result(graded.grade, graded.recordings, RunFacts("", 0.0))),
        told=tuple(
            line
            for one in outcome.differences
            if one.actual is not None
            for line in _told(graded, one.check)
        ),
    )


def _starter_verdict(grade: Grade) -> MutantVerdict:
    not_judged = tuple(
        Difference(result.id, Status.FAILED, result.status) for result in grade.of(Status.ERROR)
    )
    problem = ""
    if grade.score > MOST_FOR_STARTER * grade.max_score:
        problem = (
            f"{counted_points(grade.score)} of {number(grade.max_score)}, and a starter package "
            f"may have {MOST_FOR_STARTER:.0%} at most: give the points to what the lesson is about"
        )
    return MutantVerdict(not_judged, problem)


def _told(graded: Graded, check: str) -> Iterator[str]:
    for item in graded.grade.result(check).findings:
        place, taken = "", ""
        recording = graded.recordings.get(item.scenario or "")
        if recording is not None:
            place = f" in {item.scenario}"
            stolen_s = recording.stolen_s(recording.launched_ns, recording.end_ns)
            taken = f" (the machine took {format_duration(stolen_s)} from the run)"
        yield f"{check}{place}: {item.finding.observed}{taken}"


def selftest(
    loaded: LoadedAssignment,
    grading: Grading,
    *,
    jobs: int,
    reference: Path | None = None,
    keep: Path | None = None,
    chosen: Callable[[Trial], bool] = lambda _: True,
    on_start: Callable[[Trial], None] = lambda _: None,
    on_graded: Callable[[Graded], None] = lambda _: None,
) -> Iterator[TrialResult]:
    """Run every trial of an assignment."""
    base = load_mutants(loaded.assignment, loaded.folder, reference).reference
    with Scratch("selftest") as folder:

        def work(trial: Trial) -> TrialResult:
            on_start(trial)
            result = run_trial(trial, loaded, grading, base, folder, on_graded)
            if keep is not None and not result.verdict.right:
                for part in ("submissions", "recordings"):
                    _keep(folder / part / trial.id, keep / trial.id / part)
            return result

        with ThreadPoolExecutor(max_workers=jobs) as pool:
            futures = [
                pool.submit(work, trial) for trial in trials(loaded, reference) if chosen(trial)
            ]
            try:
                for future in as_completed(futures):
                    yield future.result()
            except BaseException:
                for future in futures:
                    future.cancel()
                grading.close()
                raise


def _keep(folder: Path, target: Path) -> None:
    if folder.is_dir():
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(folder, target, symlinks=True)


@dataclass(frozen=True)
class MutationScore:
    """How well an assignment tells right from wrong."""

    killed: int
    mutants: int
    accepted: int
    right: int
    starter_right: bool = True

    @property
    def perfect(self) -> bool:
        """Whether nothing was judged wrongly."""
        return self.killed == self.mutants and self.accepted == self.right and self.starter_right

    @property
    def percent(self) -> float:
        """Share of mutants that were judged as they must."""
        return 100.0 * self.killed / self.mutants if self.mutants else 0.0


def mutation_score(results: list[TrialResult]) -> MutationScore:
    """Count the results of one assignment."""
    mutants = [r for r in results if r.trial.role is Role.MUTANT]
    right = [r for r in results if r.trial.role in {Role.REFERENCE, Role.VARIANT}]
    return MutationScore(
        killed=sum(r.verdict.right for r in mutants),
        mutants=len(mutants),
        accepted=sum(r.verdict.right for r in right),
        right=len(right),
        starter_right=all(r.verdict.right for r in results if r.trial.role is Role.STARTER),
    )
