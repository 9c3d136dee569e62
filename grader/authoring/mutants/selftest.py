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

from grader.assignment.load import LoadedAssignment
from grader.assignment.mutant import (
    CPP,
    PYTHON,
    Change,
    Language,
    Mutant,
    apply,
    deviations,
    expected_statuses,
    load_mutants,
)
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
    changes = [*mutants.variants, *mutants.mutants]
    return (
        Trial(Role.REFERENCE, "reference", "the reference solution", None),
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
        *(
            Trial(Role.MUTANT, one.mutant.id, one.mutant.title, one.mutant, True, one.mistakes)
            for one in with_standard_mutants(loaded, mutants)
        ),
        *(
            [Trial(Role.STARTER, "starter", "the starter package, untouched", None)]
            if loaded.assignment.packages
            else []
        ),
    )


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
    handed_in = HandedIn(submission, folder / "graded" / trial.id, given=given)
    graded = grade(handed_in, setup.grading.imposing(trial.mistakes))
    setup.on_graded(graded)
    actual = {result.id: result.status for result in graded.grade.results}
    if trial.role is Role.STARTER:
        wrong = _wrong_with_starter(graded.grade)
    elif trial.change is None:
        wrong = deviations(dict.fromkeys(actual, Status.PASSED), actual)
    else:
        put_right = [result.id for result in graded.grade.results if result.put_right]
        expected = expected_statuses(loaded.assignment, trial.change, put_right)
        for result in graded.grade.results:
            # Where the node does not declare a parameter, a check may fail by that, or may not.
            if result.status is Status.SKIPPED and set(result.waits_for) <= expected.keys():
                lost = all(expected[root] is Status.FAILED for root in result.waits_for)
                expected[result.id] = Status.SKIPPED if lost else expected[result.id]
        wrong = deviations(expected, actual)
        if trial.is_derived and not any(status is Status.FAILED for status in actual.values()):
            wrong = {trial.id: f"changes nothing here: write `derived: {{{trial.id}: false}}`"}
    return TrialResult(
        trial=trial,
        wrong=wrong,
        lost=tuple(name for name, status in actual.items() if status is Status.FAILED),
        graded=graded.grade.graded,
        repeated=any(count > 1 for count in graded.runs.values()),
        grade=grade_json(make_result(graded.grade, graded.recordings, RunFacts("", 0.0))),
        findings=tuple(
            line for check in wrong if check in actual for line in _findings(graded, check)
        ),
    )


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
        place, taken = "", ""
        recording = graded.recordings.get(item.scenario or "")
        if recording is not None:
            place = f" in {item.scenario}"
            stolen_s = recording.stolen_s(recording.launched_ns, recording.end_ns)
            taken = f" (the machine took {format_duration(stolen_s)} from the run)"
        yield f"{check}{place}: {item.finding.observed}{taken}"


def selftest(
    setup: Setup, every: Iterable[Trial], *, jobs: int, keep: Path | None = None
) -> Iterator[TrialResult]:
    """Run trials of an assignment."""
    with Scratch("selftest") as folder:

        def work(trial: Trial) -> TrialResult:
            result = run_trial(trial, setup, folder)
            if keep is not None and result.wrong:
                shutil.rmtree(keep / trial.id, ignore_errors=True)
                recordings = folder / "graded" / trial.id / RECORDINGS_FOLDER
                parts = {"submissions": folder / "submissions" / trial.id, "recordings": recordings}
                for part, made in parts.items():
                    if made.is_dir():
                        shutil.copytree(made, keep / trial.id / part, symlinks=True)
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
    mutants = [r for r in results if r.trial.role is Role.MUTANT]
    right = [r for r in results if r.trial.role in {Role.REFERENCE, Role.VARIANT}]
    return MutationScore(
        killed=sum(not r.wrong for r in mutants),
        mutants=len(mutants),
        derived=sum(r.trial.is_derived for r in mutants),
        accepted=sum(not r.wrong for r in right),
        right=len(right),
        perfect=not any(r.wrong for r in results),
    )
