"""What must be the same whenever the same submission is graded, and what need not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from pydantic import BaseModel

from grader.findings.finding import Evidence
from grader.report.model.result import GRADE, differences, grade_json
from grader.report.model.result_model import CheckPart, Result
from tests.report.sample import lost_points

MEASURED = {"schema", "rosgrade_version", "environment", "started", "duration_s"}
# Of a person or of the course: they come after the grade of the checks.
ADDED = {"adjustments", "comments", "attempts", "hints_opened"}
MEASURED_OF_A_CHECK = {"observed", "disturbed", "traceback", "evidence"}


def result() -> Result:
    return lost_points().result


def changed(model: BaseModel, **values: Any) -> Any:
    return model.model_copy(update=values)


def with_check(**values: Any) -> Result:
    made = result()
    return changed(made, checks=(changed(made.checks[0], **values), *made.checks[1:]))


def with_seed(seed: int) -> Result:
    made = result()
    return changed(made, scenarios=(changed(made.scenarios[0], seed=seed),))


def test_every_part_of_a_result_is_one_or_the_other() -> None:
    assert {name.rstrip("_") for name in Result.model_fields} == set(GRADE) | MEASURED | ADDED
    assert not set(GRADE) & (MEASURED | ADDED)
    of_a_check = set(GRADE["checks"]["__all__"])
    assert set(CheckPart.model_fields) == of_a_check | MEASURED_OF_A_CHECK | {"cause"}
    assert not of_a_check & MEASURED_OF_A_CHECK


@pytest.mark.parametrize(
    "other",
    [
        changed(result(), started="later", duration_s=99.0, environment={"sandbox": "none"}),
        changed(result(), submission=changed(result().submission, id="somebody else")),
        with_check(observed="301 ms", evidence=Evidence(log=("x",))),
        changed(result(), scenarios=(changed(result().scenarios[0], duration_s=9.0),)),
        changed(result(), build=replace(result().build, cached=True, log="in /tmp/x")),
    ],
)
def test_measurements_are_no_part_of_it(other: Result) -> None:
    assert grade_json(other) == grade_json(result())
    assert differences(grade_json(result()), grade_json(other)) == []


@pytest.mark.parametrize(
    ("other", "line"),
    [
        (changed(result(), score=1.0), '+  "score": 1.0,'),
        (with_check(points=0.25), '+      "points": 0.25,'),
        (with_check(hint="Do it otherwise."), '+      "hint": "Do it otherwise.",'),
        (with_check(expected="another"), '+      "expected": "another",'),
        (changed(result(), checks=result().checks[1:]), f'-      "id": "{result().checks[0].id}",'),
        (changed(result(), build=None), '+  "build": null'),
        (
            changed(result(), scenarios=(changed(result().scenarios[0], seed=8),)),
            '+      "seed": 8',
        ),
    ],
)
def test_a_difference_is_shown(other: Result, line: str) -> None:
    assert grade_json(other) != grade_json(result())
    assert line in differences(grade_json(result()), grade_json(other))
