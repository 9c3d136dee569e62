"""``result.json``: what programs rely on."""

import json
import re

import pytest

from grader.assignment.load import load_assignment
from grader.errors import UsageError
from grader.findings.finding import Evidence, Finding, Plot
from grader.grade import judge_all
from grader.report.model.result import (
    make_result,
    read_result,
    result_json,
    result_schema,
)
from tests.assignment.lessons import GOOD
from tests.grade.sample import FAIL, PASS, Told, make_submission
from tests.report.sample import (
    PLACE,
    everywhere,
    full_points,
    judged,
    lost_points,
    make_facts,
    not_built,
    not_graded,
)


def written(sample):
    return json.loads(result_json(sample.result))


def test_the_keys_of_the_contract():
    data = written(lost_points())
    assert list(data) == [
        "schema",
        "rosgrade_version",
        "assignment",
        "submission",
        "score",
        "max_score",
        "graded",
        "first_to_fix",
        "checks",
        "withheld",
        "scenarios",
        "names",
        "build",
        "environment",
        "started",
        "duration_s",
        "adjustments",
        "comments",
        "attempts",
        "hints_opened",
        "final_score",
        "final_max_score",
    ]
    named = "id title status points max_points visibility expected observed hint scenario evidence"
    assert set(named.split()) <= set(data["checks"][0])


def test_the_score_and_what_to_fix():
    data = written(lost_points())
    assert (data["schema"], data["score"], data["max_score"]) == (1, 3.02, 7.0)
    assert (data["graded"], data["first_to_fix"]) == (True, "period")
    assert data["assignment"]["id"] == "timed_publisher"
    assert data["assignment"]["sha256"] == "ab" * 32


def test_where_the_assignment_lies_is_known_unless_it_is_one_of_rosgrade_s_own(tmp_path):
    (tmp_path / "lesson").mkdir()
    (tmp_path / "lesson" / "assignment.yaml").write_text(GOOD, encoding="utf-8")
    for name, location in ((tmp_path / "lesson", str(tmp_path / "lesson")), ("qos", None)):
        judged = judge_all(load_assignment(name), make_submission(), {})
        assert make_result(judged, {}, make_facts()).assignment.location == location


def test_a_check_with_its_evidence():
    period = written(lost_points())["checks"][1]
    assert (period["status"], period["points"], period["max_points"]) == ("failed", 1.02, 3.0)
    assert period["scenario"] == "listen"
    assert period["author_hint"].startswith("Let a timer do the waiting")
    place = {"file": PLACE.file, "line": 18, "message": "time.sleep(0.3)"}
    assert period["evidence"]["places"] == [place]
    assert period["evidence"]["plots"][0]["band"] == [285.0, 315.0]
    # The hint of an author is not given away where a check passed.
    assert {check["author_hint"] for check in written(full_points())["checks"]} == {""}


def test_a_run_is_in_the_result():
    (scenario,) = written(lost_points())["scenarios"]
    assert scenario == {
        "id": "listen",
        "seed": 7,
        "recording": "recordings/listen.mcap",
        "ending": "until",
        "duration_s": 2.0,
        "disturbance": {"taken_s": 0.0021, "worst_late_s": 0.0004},
        "faults": [],
        "breaches": [],
        "remarks": [],
        "runs": 1,
    }


def test_a_check_of_several_scenarios_names_the_one_that_decided_and_the_others():
    says = {"a": PASS, "b": FAIL, "c": PASS}
    (check,) = written(judged([Told("node", says)], tuple(says)))["checks"]
    assert (check["scenario"], check["observed"]) == ("b", "no node at all")
    others = [(other["scenario"], other["status"]) for other in check["other_scenarios"]]
    assert others == [("a", "passed"), ("c", "passed")]


def test_without_a_verdict_there_is_no_number_that_a_gradebook_could_take():
    data = written(not_graded())
    assert (data["graded"], data["score"], data["max_score"]) == (False, None, 4.0)
    assert "KeyError: 'depth'" in data["checks"][1]["traceback"]


def test_numbers_that_json_does_not_know_become_strings():
    values = (float("nan"), float("inf"), float("-inf"), 0.1 + 0.2)
    plot = Plot("", "", "", values, values)
    finding = Finding.passed("", "", Evidence(plots=(plot,)))
    text = result_json(judged([Told("node", finding)]).result)
    assert not re.search(r"[:\[,]\s*-?(NaN|Infinity)", text)
    plot_part = json.loads(text)["checks"][0]["evidence"]["plots"][0]
    assert plot_part["x"] == ["NaN", "Infinity", "-Infinity", 0.3]


SAMPLES = [lost_points, full_points, not_built, not_graded, lambda: everywhere("\udcff<\x1b[0m>")]


@pytest.mark.parametrize("make", SAMPLES)
def test_what_is_written_is_read_again_and_is_the_same_every_time(make, tmp_path):
    result, file = make().result, tmp_path / "result.json"
    file.write_text(result_json(result), encoding="utf-8")
    assert read_result(file) == result
    assert result_json(read_result(file)) == result_json(make().result)


def test_the_schema_describes_what_is_written():
    schema = result_schema()
    assert schema["properties"]["schema"] == {"const": 1, "title": "Schema", "type": "integer"}
    assert set(schema["properties"]) == set(written(full_points()))
    # What the earlier results of this schema lack.
    new = {"names", "adjustments", "comments", "attempts", "hints_opened"}
    assert set(schema["required"]) == set(schema["properties"]) - new


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", r"result\.json is not a result that this rosgrade reads: Invalid JSON"),
        ('["schema"]', r"Input should be an object"),
        ('{"schema": 2}', r"not a result that this rosgrade reads: schema: Input should be 1"),
        ('{"schema": 1}', r"rosgrade_version: Field required"),
    ],
)
def test_a_file_that_is_no_result_is_refused(text, message, tmp_path):
    file = tmp_path / "result.json"
    file.write_text(text)
    with pytest.raises(UsageError, match=message):
        read_result(file)
    file.unlink()
    with pytest.raises(UsageError, match=r"result\.json cannot be read: No such file"):
        read_result(file)
