"""What a class keeps of its results: enough for all that is about the class, and little."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

from grader.findings.finding import Evidence
from grader.report.formats.gradebook import grades_csv
from grader.report.html.overview import render_overview
from grader.report.model.class_row import for_class
from grader.report.model.mistakes import reasons
from grader.report.model.result import result_json
from grader.report.model.result_model import Result
from tests.report.classroom import classroom
from tests.report.sample import full_points, lost_points


def test_overview_and_gradebook_are_those_of_the_whole_results() -> None:
    rows = classroom(20)
    kept = [replace(row, result=row.result and for_class(row.result)) for row in rows]
    assert render_overview(kept) == render_overview(rows)
    assert grades_csv(kept) == grades_csv(rows)
    assert [one.result and reasons(one.result.checks) for one in kept] == [
        one.result and reasons(one.result.checks) for one in rows
    ]


def test_who_passes_the_same_checks_shares_them() -> None:
    one, other = (for_class(full_points().result) for _ in range(2))
    assert all(mine is theirs for mine, theirs in zip(one.checks, other.checks, strict=True))


def test_a_large_class_holds_no_plot_and_no_log() -> None:
    """At most 20 KiB a row, whatever a result holds: 10,000 rows are at most 200 MB."""
    whole = lost_points().result
    log = tuple(f"line {number}" for number in range(2_000))
    checks = tuple(
        check.model_copy(update={"evidence": replace(check.evidence, log=log)})
        for check in whole.checks
    )
    text = result_json(whole.model_copy(update={"checks": checks}))
    assert len(text) > 100_000
    for_class(Result.model_validate_json(text))
    tracemalloc.start()
    try:
        kept = [for_class(Result.model_validate_json(text)) for _ in range(100)]
        retained, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert retained / len(kept) < 20 * 1024
    assert all(not check.evidence.log for check in kept[0].checks)
    assert any(check.evidence != Evidence() for check in kept[0].checks)
