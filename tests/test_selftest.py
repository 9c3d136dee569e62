"""Every assignment of ours tells right from wrong: mutation score 100 %, with real nodes.

The robot assignments have many scenarios for each of many mutants; here every eighth trial is
graded, so that the tests stay short. `rosgrade selftest` grades them all.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from grader import ros
from grader.assignment.load import list_assignments, load_assignment
from grader.batch.grading import Grading
from grader.batch.selftest import Role, mutation_score, selftest, trials
from grader.run.admission import cpu_count
from grader.run.runner import Runner

LEAST_MUTANTS = 12
EVERY = 8


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", list_assignments())
def test_the_mutation_score_is_perfect(name: str, tmp_path: Path) -> None:
    loaded = load_assignment(name)
    grading = Grading(loaded, Runner(ros.find()), tmp_path / "cache")
    every = trials(loaded)
    assert sum(trial.role is Role.MUTANT for trial in every) >= LEAST_MUTANTS
    robot = any(scenario.world for scenario in loaded.assignment.scenarios)
    kept = {trial.id for trial in (every[::EVERY] if robot else every)}
    results = list(
        selftest(loaded, grading, jobs=2 * cpu_count(), chosen=lambda trial: trial.id in kept)
    )
    wrong = {
        result.trial.id: [str(difference) for difference in result.verdict.differences]
        for result in results
        if not result.verdict.right
    }
    assert not wrong
    assert mutation_score(results).perfect
