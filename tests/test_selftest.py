"""Every assignment of ours tells right from wrong: mutation score 100 %, with real nodes."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader import ros
from grader.assignment.load import list_assignments, load_assignment
from grader.batch.grading import Grading
from grader.batch.selftest import mutation_score, selftest
from grader.run.admission import cpu_count
from grader.run.runner import Runner

LEAST_MUTANTS = 12


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", list_assignments())
def test_the_mutation_score_is_perfect(name: str, tmp_path: Path) -> None:
    loaded = load_assignment(name)
    grading = Grading(loaded, Runner(ros.find()), tmp_path / "cache")
    results = list(selftest(loaded, grading, jobs=2 * cpu_count()))
    wrong = {
        result.trial.id: [str(difference) for difference in result.verdict.differences]
        for result in results
        if not result.verdict.right
    }
    assert not wrong
    score = mutation_score(results)
    assert score.perfect
    assert score.mutants >= LEAST_MUTANTS
