"""The mutation score of an assignment: does it tell right from wrong?

The reference and every variant (a right solution in another style) must get full points; every
mutant must lose exactly the checks that it names; the starter package, untouched, must get
almost nothing. Mutants are those of mutants.yaml, and the standard ones of the contract.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from grader.assignment.changed_reference import apply
from grader.assignment.expected_statuses import deviations, expected_statuses
from grader.assignment.load import LoadedAssignment
from grader.assignment.mutant import Change, Mutant
from grader.assignment.mutant_file import load_mutants
from grader.assignment.reference import CPP, PYTHON, Language
from grader.authoring.mutants.standard import with_standard_mutants
from grader.authoring.starter import write_starter
from grader.findings.finding import Status
from grader.grade.model import Grade
from grader.grading.graded import RECORDINGS_FOLDER, Graded
from grader.grading.grading import Grading
from grader.grading.spine import HandedIn, grade
from grader.machine.scratch import Scratch
from grader.report.model.facts import RunFacts
from grader.report.model.result import grade_json, make_result
from grader.report.text.words import counted_points, number
from grader.run.imposing.mistake import Mistake
from grader.spec.unit import format_duration

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
    """One submission to grade, with the outcome that it must have.

    Attributes:
        is_derived: It is a standard mutant.
        mistakes: What the run imposes on the reference.
    """

    role: Role
    id: str
    title: str
    change: Change | None
    is_derived: bool = False
    mistakes: tuple[Mistake, ...] = ()


@dataclass(frozen=True)
class TrialResult:
    """How a trial went, without its recordings: an assignment has a hundred trials and more.

    Attributes:
        wrong: What ended otherwise than it must, by its check; nothing if all is well.
    """

    trial: Trial
    wrong: Mapping[str, str]
    lost: tuple[str, ...]
    graded: bool
    repeated: bool
    grade: str
    findings: tuple[str, ...] = ()

    @property
    def mistake(self) -> str:
        """What is wrong with the grade, in one line; nothing if it is as it must be."""
        return "; ".join(f"{check}: {words}" for check, words in self.wrong.items())


def trials(loaded: LoadedAssignment, language: Language = PYTHON) -> tuple[Trial, ...]:
    """The trials of an assignment: its reference, its variants, its mutants, its starter."""
    mutants = load_mutants(loaded.assignment, loaded.folder, language=language)
    every = [Trial(Role.REFERENCE, "reference", "the reference solution", None)]
    for change in (*mutants.variants, *mutants.mutants):
        if not change.skip_reason:
            role = Role.MUTANT if isinstance(change, Mutant) else Role.VARIANT
            every.append(Trial(role, change.id, change.title, change))
    for standard in with_standard_mutants(loaded, mutants):
        mutant = standard.mutant
        mistakes = standard.mistakes
        every.append(Trial(Role.MUTANT, mutant.id, mutant.title, mutant, True, mistakes))
    if loaded.assignment.packages:
        every.append(Trial(Role.STARTER, "starter", "the starter package, untouched", None))
    return tuple(every)


@dataclass(frozen=True)
class Setup:
    """What the trials of an assignment are graded with.

    Attributes:
        reference: The folder of the solution that mutants and variants are made from.
        on_graded: Gets each grade with its recordings, which are not kept.
    """

    loaded: LoadedAssignment
    grading: Grading
    reference: Path
    language: Language = PYTHON
    on_graded: Callable[[Graded], None] = lambda _: None


def run_trial(trial: Trial, setup: Setup, folder: Path) -> TrialResult:
    """Grade one trial."""
    graded = grade(_handed_in(trial, setup, folder), setup.grading.imposing(trial.mistakes))
    setup.on_graded(graded)
    wrong = _wrong(trial, setup.loaded, graded.grade)
    statuses = {result.id: result.status for result in graded.grade.results}
    return TrialResult(
        trial=trial,
        wrong=wrong,
        lost=tuple(check for check, status in statuses.items() if status is Status.FAILED),
        graded=graded.grade.graded,
        repeated=any(count > 1 for count in graded.runs.values()),
        grade=grade_json(make_result(graded.grade, graded.recordings, RunFacts("", 0.0))),
        findings=tuple(
            line for check in wrong if check in statuses for line in _findings(graded, check)
        ),
    )


def _handed_in(trial: Trial, setup: Setup, folder: Path) -> HandedIn:
    """The submission of a trial, which is written first unless it is the reference itself."""
    loaded, submission = setup.loaded, folder / "submissions" / trial.id
    if trial.role is Role.STARTER:
        write_starter(loaded, submission, cpp=setup.language is CPP)
    elif trial.change is None or trial.mistakes:
        submission = setup.reference
    else:
        apply(trial.change, setup.reference, submission)
    # There is no roster, and the reference has the author's examples.
    given = {
        name: loaded.values[name]
        for name, variable in loaded.assignment.variables.items()
        if variable.match is None
    }
    return HandedIn(submission, folder / "graded" / trial.id, given=given)


def _wrong(trial: Trial, loaded: LoadedAssignment, grade: Grade) -> dict[str, str]:
    """What ended otherwise than it must, by its check."""
    actual = {result.id: result.status for result in grade.results}
    if trial.role is Role.STARTER:
        return _wrong_with_starter(grade)
    if trial.change is None:
        return deviations(dict.fromkeys(actual, Status.PASSED), actual)
    if trial.is_derived and Status.FAILED not in actual.values():
        return {trial.id: f"changes nothing here: write `derived: {{{trial.id}: false}}`"}
    put_right = [result.id for result in grade.results if result.put_right]
    expected = expected_statuses(loaded.assignment, trial.change, put_right)
    for result in grade.results:
        if result.status is not Status.SKIPPED:
            continue
        # Where the node does not declare a parameter, a check may fail by that, or may not.
        if all(expected.get(check) is Status.FAILED for check in result.waits_for):
            expected[result.id] = Status.SKIPPED
    return deviations(expected, actual)


def _wrong_with_starter(grade: Grade) -> dict[str, str]:
    wrong = {
        result.id: "error instead of failed"
        for result in grade.results
        if result.status is Status.ERROR
    }
    if grade.score > MOST_FOR_STARTER * grade.max_score:
        wrong["points"] = (
            f"{counted_points(grade.score)} of {number(grade.max_score)}, and a starter package "
            f"may have {MOST_FOR_STARTER:.0%} at most: give the points for what the lesson teaches"
        )
    return wrong


def _findings(graded: Graded, check: str) -> Iterator[str]:
    for item in graded.grade.result(check).findings:
        recording = graded.recordings.get(item.scenario or "")
        if recording is None:
            yield f"{check}: {item.finding.observed}"
            continue
        stolen_s = recording.stolen_s(recording.launched_ns, recording.end_ns)
        taken = f"the machine took {format_duration(stolen_s)} from the run"
        yield f"{check} in {item.scenario}: {item.finding.observed} ({taken})"


def selftest(
    setup: Setup, every: Iterable[Trial], *, jobs: int, keep: Path | None = None
) -> Iterator[TrialResult]:
    """Run trials of an assignment."""
    with Scratch("selftest") as folder:

        def work(trial: Trial) -> TrialResult:
            result = run_trial(trial, setup, folder)
            if keep is not None and result.wrong:
                _keep(trial, folder, keep / trial.id)
            return result

        with ThreadPoolExecutor(max_workers=jobs) as pool:
            futures = [pool.submit(work, trial) for trial in every]
            try:
                for future in as_completed(futures):
                    yield future.result()
            except BaseException:
                for future in futures:
                    future.cancel()
                setup.grading.close()
                raise


def _keep(trial: Trial, folder: Path, target: Path) -> None:
    """Keep a submission and its recordings, for the author to look at."""
    shutil.rmtree(target, ignore_errors=True)
    parts = {
        "submissions": folder / "submissions" / trial.id,
        "recordings": folder / "graded" / trial.id / RECORDINGS_FOLDER,
    }
    for name, part in parts.items():
        if part.is_dir():
            shutil.copytree(part, target / name, symlinks=True)


@dataclass(frozen=True)
class MutationScore:
    """How well an assignment tells right from wrong."""

    killed: int
    mutants: int
    derived: int
    accepted: int
    right: int
    perfect: bool

    @property
    def words(self) -> str:
        """It in a line."""
        derived = f" ({self.derived} follow from the contract)" if self.derived else ""
        percent = 100.0 * self.killed / self.mutants if self.mutants else 0.0
        return (
            f"{self.accepted} of {self.right} right solutions with full points, {self.killed} of "
            f"{self.mutants} mutants judged as expected{derived}: mutation score {percent:.0f} %"
        )


def mutation_score(results: list[TrialResult]) -> MutationScore:
    """Count the results of one assignment."""
    mutants = [result for result in results if result.trial.role is Role.MUTANT]
    right = [one for one in results if one.trial.role in {Role.REFERENCE, Role.VARIANT}]
    return MutationScore(
        killed=len([result for result in mutants if not result.wrong]),
        mutants=len(mutants),
        derived=len([result for result in mutants if result.trial.is_derived]),
        accepted=len([result for result in right if not result.wrong]),
        right=len(right),
        perfect=not any(result.wrong for result in results),
    )
