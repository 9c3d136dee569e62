"""Every assignment of rosgrade tells right from wrong: mutation score 100 %, with real nodes.

Some assignments have many scenarios for each of many mutants, and the examples of the
documentation are many: of those every 24th or every eighth trial is graded here, so that the
tests stay short. `rosgrade selftest` grades them all.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from grader.assignment.load import list_assignments, load_assignment
from grader.assignment.mutant import reference_of
from grader.authoring.mutants.selftest import Role, Setup, mutation_score, selftest, trials
from grader.grading.grading import Grading
from grader.grading.type_support import missing_underlays
from grader.machine import resources, ros
from grader.machine.load import cpu_count
from grader.run.runner import Runner

LEAST_MUTANTS = 12
EVERY = 24
EVERY_OF_EXAMPLE = 8
MOST_RUNS = 20
EXAMPLES = {
    file.parent.name: file.parent
    for file in (resources.root() / "docs" / "examples").glob("*/assignment.yaml")
}
COMPILED = ("custom_interface", "action_server", "group_project")
NAMES = [
    pytest.param(name, marks=[pytest.mark.compiles] if name in COMPILED else [])
    for name in (*list_assignments(), *EXAMPLES)
]


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    """Runs the trials of all assignments: what it prepares is made once."""
    with Runner(ros.find()) as made:
        yield made


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", NAMES)
def test_the_mutation_score_is_perfect(name: str, runner: Runner) -> None:
    loaded = load_assignment(EXAMPLES.get(name, name))
    for missing in missing_underlays(loaded):
        pytest.skip(missing)
    every = trials(loaded)
    assert sum(trial.role is Role.MUTANT for trial in every) >= LEAST_MUTANTS
    scenarios = loaded.assignment.scenarios
    robot = any(scenario.world for scenario in scenarios)
    many = robot or len(every) * len(scenarios) > MOST_RUNS
    step = EVERY if many else EVERY_OF_EXAMPLE if name in EXAMPLES else 1
    kept = {trial.id: trial for trial in (*every[::step], every[-1])}.values()
    grading = Grading(loaded, runner, resources.cache_folder())
    setup = Setup(loaded, grading, reference_of(loaded.assignment.id, loaded.folder))
    results = list(selftest(setup, kept, jobs=2 * cpu_count()))
    wrong = {
        result.trial.id: (result.mistake, *result.findings) for result in results if result.wrong
    }
    assert not wrong
    assert mutation_score(results).perfect
