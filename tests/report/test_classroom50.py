"""Classroom 50's result.json, against its contract."""

from __future__ import annotations

import json

import pytest

from grader.errors import GraderFault, UsageError
from grader.findings.finding import Finding
from grader.report.formats.classroom50 import identity, render_release, render_result, whole_factor
from tests.assignment.validator import valid
from tests.grade.sample import Told
from tests.report.sample import full_points, judged, lost_points, not_built, not_graded

ENVIRONMENT = {
    "CLASSROOM": "ros2",
    "ASSIGNMENT": "timed-publisher",
    "SUBMISSION_TAG": "submit/2026-06-01T14-32-05Z-a1b2c3d",
    "COMMIT_URL": "https://example.org/commit/1",
    "RELEASE_URL": "https://example.org/releases/1",
}
WHEN = "2026-06-01T14:32:01Z"
# Written from the table of the contract, wiki page "Advanced Autograding".
TEXT = {"type": "string", "minLength": 1}
POINTS = {"type": "integer", "minimum": 0}


def obj(**properties):
    named = {name.replace("_", "-"): value for name, value in properties.items()}
    return {"type": "object", "required": list(named), "properties": named}


TEST = obj(test_name=TEXT, passed={"type": "boolean"}, score=POINTS, max_score=POINTS)
SCHEMA = obj(
    schema={"const": "classroom50/result/v1"},
    **dict.fromkeys(("classroom", "assignment", "submission", "commit", "release", "review"), TEXT),
    datetime={"type": "string", "pattern": r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$"},
    score=POINTS,
    max_score=POINTS,
    tests={"type": "array", "items": TEST},
)


def rendered(result):
    return json.loads(render_result(result, **identity(ENVIRONMENT), datetime=WHEN))


def points(*worth, credit=0.0):
    checks = [Told("first", Finding.failed("e", "o", credit=credit), points=worth[0])]
    checks += [Told(f"c{number}", points=value) for number, value in enumerate(worth[1:])]
    return judged(checks).result


@pytest.mark.parametrize("make", [full_points, lost_points, not_built])
def test_it_keeps_the_contract(make):
    data = rendered(make().result)
    assert valid(data, SCHEMA, SCHEMA)
    assert data["score"] == sum(test["score"] for test in data["tests"])
    assert data["max-score"] == sum(test["max-score"] for test in data["tests"])
    assert all(test["passed"] <= (test["score"] == test["max-score"]) for test in data["tests"])
    assert data["datetime"] == WHEN


@pytest.mark.parametrize(
    ("worth", "factor"), [((1, 2), 1), ((0.5, 1), 2), ((0.25, 1), 4), ((0.1, 0.5), 10)]
)
def test_points_are_made_whole_by_one_factor(worth, factor):
    result = points(*worth)
    assert whole_factor(result) == factor
    assert rendered(result)["max-score"] == round(sum(worth) * factor)
    assert (f"every point as {factor}" in render_release(result)) == (factor > 1)


def test_partial_credit_is_rounded_down_so_that_only_a_passed_check_is_full():
    (first, _) = rendered(points(3, 1, credit=0.999))["tests"]
    assert (first["score"], first["max-score"], first["passed"]) == (2, 3, False)


def test_hidden_checks_are_neither_named_nor_counted():
    result = lost_points().result
    text = render_result(result, **identity(ENVIRONMENT), datetime=WHEN) + render_release(result)
    assert "SIGINT" not in text and "ends" not in [t["id"] for t in rendered(result)["tests"]]
    assert "1 hidden check, 1 point, runs at grading" in render_release(result)


def test_without_a_grade_there_is_no_result():
    with pytest.raises(GraderFault, match="no result for Classroom 50"):
        rendered(not_graded().result)


def test_what_the_runner_did_not_say_is_named():
    with pytest.raises(UsageError, match="the environment lacks COMMIT_URL, RELEASE_URL"):
        identity({k: v for k, v in ENVIRONMENT.items() if not k.endswith("_URL")})
