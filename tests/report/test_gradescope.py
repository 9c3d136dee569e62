"""Gradescope's results.json, against its specification."""

from __future__ import annotations

import json

import pytest

from grader.errors import UsageError
from grader.findings.finding import Finding
from grader.recording.event import Breach
from grader.report.formats.gradescope import read_metadata, render, unfinished
from tests.assignment.validator import valid
from tests.grade.sample import Told
from tests.report.sample import (
    everywhere,
    full_points,
    judged,
    judged_runs,
    lost_points,
    make_run,
    not_built,
    not_graded,
    reached_limits,
)


def obj(**properties):
    return {"type": "object", "additionalProperties": False, "properties": properties}


# Written from https://gradescope-autograders.readthedocs.io/en/latest/specs/
NUMBER, TEXT = {"type": "number"}, {"type": "string"}
VISIBILITY = {"enum": ["hidden", "after_due_date", "after_published", "visible"]}
FORMAT = {"enum": ["text", "html", "simple_format", "md", "ansi"]}
TEST = obj(
    score=NUMBER,
    max_score=NUMBER,
    status={"enum": ["passed", "failed"]},
    name=TEXT,
    name_format=FORMAT,
    number=TEXT,
    output=TEXT,
    output_format=FORMAT,
    tags={"type": "array", "items": TEXT},
    visibility=VISIBILITY,
    extra_data={"type": "object"},
)
SCHEMA = obj(
    score=NUMBER,
    execution_time=NUMBER,
    output=TEXT,
    output_format=FORMAT,
    test_output_format=FORMAT,
    test_name_format=FORMAT,
    visibility=VISIBILITY,
    stdout_visibility=VISIBILITY,
    extra_data={"type": "object"},
    leaderboard={"type": "array"},
    tests={"type": "array", "items": TEST},
) | {"required": ["score"]}


def rendered(make, **options):
    return json.loads(render(make().result, **options))


@pytest.mark.parametrize(
    "make",
    [
        full_points,
        lost_points,
        not_built,
        not_graded,
        reached_limits,
        lambda: everywhere("\udcff<b>\x1b[0m`|"),
    ],
)
def test_it_follows_the_specification(make):
    assert valid(rendered(make), SCHEMA, SCHEMA)


def test_scores_and_whose_test_it_is():
    data = rendered(lost_points)
    assert data["score"] == 3.02
    tests = {test["extra_data"]["id"]: test for test in data["tests"]}
    assert (tests["period"]["score"], tests["period"]["max_score"]) == (1.02, 3.0)
    assert tests["period"]["status"] == "failed"
    assert tests["period"]["tags"] == ["listen"]
    assert "**try next:** The period grows" in tests["period"]["output"]
    assert tests["builds"]["status"] == "passed"
    assert [test["number"] for test in data["tests"]] == ["1", "2", "3", "4"]
    assert sum(test["score"] for test in data["tests"]) == pytest.approx(data["score"])


@pytest.mark.parametrize("visibility", ["visible", "after_due_date", "after_published", "hidden"])
def test_gradescope_hides_what_the_author_hides(visibility):
    checks = [
        Told("seen"),
        Told("other", Finding.failed("zq1", "zq2", "zq3"), title="zq4", visibility=visibility),
    ]
    data = rendered(lambda: judged(checks))
    assert data["tests"][1]["visibility"] == visibility
    if visibility != "visible":
        assert "zq" not in data["output"]
        assert (
            "1 of 1 visible checks passed; 1 hidden check, 1 point, runs at grading"
            in (data["output"])
        )
    assert data["stdout_visibility"] == "hidden"


def test_limits_and_remarks_are_in_the_output():
    data = rendered(reached_limits)
    assert (
        "**Limits of the sandbox that were reached**\n\n"
        "- scenario listen: its processes took 1056 MiB of memory, 1024 MiB are allowed\n"
    ) in data["output"]
    assert "**Worth knowing**" in data["output"]
    assert data["output"].endswith("- 10 more: see the report")
    assert len(data["output"]) < 20 * 600
    assert data["score"] == sum(test["max_score"] for test in data["tests"])


def test_limits_of_a_run_that_only_hidden_checks_judge_are_left_out():
    checks = [
        Told("seen", scenarios=("listen",)),
        Told("other", scenarios=("secret",), visibility="hidden"),
    ]
    recordings = {
        "listen": make_run(),
        "secret": make_run(scenario="secret", breaches=(Breach(1, "disk", "zq", "1 MiB"),)),
    }
    result = judged_runs(checks, recordings).result
    assert "zq" in result.scenarios[1].breaches[0]
    assert "zq" not in render(result)


def test_what_is_not_graded_is_no_silent_zero():
    before = json.loads(unfinished())
    assert valid(before, SCHEMA, SCHEMA)
    assert (before["score"], before["extra_data"]["graded"]) == (0, False)
    assert "Grading did not finish" in before["output"]
    data = rendered(not_graded)
    assert data["score"] == 0
    assert data["output"].startswith("**Not graded.** This 0 is a placeholder")
    assert all("score" not in test for test in data["tests"])
    assert data["extra_data"]["graded"] is False


DUE = "2026-03-04T23:59:00.000000-08:00"
EXTENSION = [{"assignment": {"due_date": "2026-03-06T23:59:00-08:00"}}]


@pytest.mark.parametrize(
    ("created", "due", "users", "late"),
    [
        ("2026-03-04T23:58:59.000000-08:00", DUE, [{"name": "Ada"}], 0.0),
        ("2026-03-05T08:59:00.000000+00:00", DUE, [{"name": "Ada"}], 3600.0),
        ("2026-03-05T08:59:00Z", DUE, [], 3600.0),
        ("2026-03-05T12:00:00-08:00", DUE, EXTENSION, 0.0),
        (DUE, None, [], None),
    ],
)
def test_lateness_is_counted_from_the_submission_and_never_from_now(
    created, due, users, late, tmp_path
):
    metadata = {"created_at": created, "assignment": {"due_date": due}, "users": users}
    file = tmp_path / "submission_metadata.json"
    file.write_text(json.dumps(metadata))
    extra = rendered(full_points, metadata=file)["extra_data"]
    assert extra["late_s"] == late and extra["created_at"][:10] == created[:10]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "Invalid JSON"),
        ("[]", "is not Gradescope's submission_metadata.json"),
        ('{"created_at": "soon"}', "created_at"),
    ],
)
def test_metadata_that_is_none_is_named(text, said, tmp_path):
    file = tmp_path / "submission_metadata.json"
    file.write_text(text)
    with pytest.raises(UsageError, match=said):
        read_metadata(file)
