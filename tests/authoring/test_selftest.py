"""Every assignment of rosgrade tells right from wrong: mutation score 100 %, with real nodes.

There are a thousand trials: of each assignment the reference and a mutant are graded here, and the
starter package, which the same code writes for all, of rosgrade's own and of an example in C++, so
that the tests stay short. `rosgrade selftest` grades them all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from grader.assignment.load import list_assignments, load_assignment
from grader.assignment.reference import reference_of
from grader.authoring.mutants.selftest import (
    Role,
    Setup,
    Trial,
    TrialResult,
    mutation_score,
    selftest,
    trials,
)
from grader.grading.grading import Grading
from grader.grading.type_support import missing_underlays
from grader.machine import resources, ros
from grader.machine.load import cpu_count
from grader.run.runner import Runner

LEAST_MUTANTS = 12
EXAMPLES = {
    file.parent.name: file.parent
    for file in (resources.root() / "docs" / "examples").glob("*/assignment.yaml")
}
COMPILED = (
    "action_server",
    "custom_interface",
    "group_project",
    "rescue_team",
    "turtle_catch",
    "turtle_square",
    "victim_report",
    "waypoints",
)
WITH_STARTER = (*list_assignments(), "action_server")
NAMES = [
    pytest.param(name, marks=[pytest.mark.compiles] if name in COMPILED else [])
    for name in (*list_assignments(), *EXAMPLES)
]


AT_ONCE = 2
"""Assignments. While a robot drives, the machine has time for another one."""


@pytest.fixture(scope="module")
def graded(request: pytest.FixtureRequest) -> Iterator[Mapping[str, Future[list[TrialResult]]]]:
    """The results of each assignment's trials, once they are there.

    One runner makes the runs of all: what it prepares is made once.
    """
    tests = [item for item in request.session.items if item.path == request.path]
    names = [test.callspec.params["name"] for test in tests if isinstance(test, pytest.Function)]
    with Runner(ros.find()) as runner:
        pool = ThreadPoolExecutor(AT_ONCE)
        yield {name: pool.submit(grade_some, name, runner) for name in names}
        # After Ctrl-C there are some left.
        pool.shutdown(wait=False, cancel_futures=True)


def grade_some(name: str, runner: Runner) -> list[TrialResult]:
    loaded = load_assignment(EXAMPLES.get(name, name))
    for missing in missing_underlays(loaded):
        pytest.skip(missing)
    every = trials(loaded)
    mutants = [trial for trial in every if trial.role is Role.MUTANT]
    assert len(mutants) >= LEAST_MUTANTS
    # A mistake that a run imposes on the reference needs no build of its own.
    imposed = [trial for trial in mutants if trial.mistakes and name in COMPILED]
    starter = every[-1:] if name in WITH_STARTER else ()
    kept = (every[0], middle(imposed or mutants), *starter)
    grading = Grading(loaded, runner, resources.cache_folder())
    setup = Setup(loaded, grading, reference_of(loaded.assignment.id, loaded.folder))
    return list(selftest(setup, kept, jobs=cpu_count()))


def middle(some: Sequence[Trial]) -> Trial:
    return some[len(some) // 2]


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_mutation_score_is_perfect(
    name: str, graded: Mapping[str, Future[list[TrialResult]]]
) -> None:
    results = graded[name].result()
    wrong = {
        result.trial.id: (result.mistake, *result.findings) for result in results if result.wrong
    }
    assert not wrong
    assert mutation_score(results).perfect
