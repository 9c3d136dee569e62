"""JUnit XML: valid for Jenkins, counted rightly by colcon, and whose fault it was."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import xmlschema

from grader.findings.finding import Finding
from grader.report.formats.junit import render
from tests.grade.sample import FAIL, Told
from tests.report.sample import (
    everywhere,
    full_points,
    judged,
    lost_points,
    not_built,
    not_graded,
    reached_limits,
)

ILLEGAL = "a\x00b\x0b\x1b[31mc\ud800\ufffe\uffff]]>\r\n<b>&amp;"
SAMPLES = {
    "full points": full_points,
    "lost points": lost_points,
    "not built": not_built,
    "not graded": not_graded,
    "limits reached": reached_limits,
    "hostile": lambda: everywhere(ILLEGAL),
}


@cache
def jenkins() -> xmlschema.XMLSchema:
    return xmlschema.XMLSchema(str(Path(__file__).with_name("junit10.xsd")))


def rendered(make, **options):
    return render(make().result, **options)


def cases_of(text):
    return {case.get("name"): case for case in ET.fromstring(text).iter("testcase")}


@pytest.mark.parametrize("name", SAMPLES)
def test_xunit2_is_valid_for_jenkins_and_xunit1_is_xml(name):
    jenkins().validate(rendered(SAMPLES[name]))
    text = rendered(SAMPLES[name], xunit1=True)
    ET.fromstring(text)
    assert not set("\x00\ud800\uffff") & set(text)


@pytest.mark.parametrize("name", SAMPLES)
def test_the_counts_are_those_of_the_elements(name):
    root = ET.fromstring(rendered(SAMPLES[name]))
    (suite,) = root
    for tag, count in (("testcase", "tests"), ("failure", "failures"), ("error", "errors")):
        assert int(suite.get(count)) == int(root.get(count)) == len(list(suite.iter(tag)))
    assert int(suite.get("skipped")) == len(list(suite.iter("skipped")))


def test_whose_fault_it_was():
    cases = cases_of(rendered(lost_points))
    assert [child.tag for child in cases["period"]] == ["failure"]
    assert [child.tag for child in cases["steady"]] == ["skipped"]
    assert not list(cases["builds"])
    cases = cases_of(rendered(not_graded))
    assert [child.tag for child in cases["depth"]] == ["error"]
    assert "KeyError" in cases["depth"][0].text


@pytest.mark.parametrize("finding", [FAIL, Finding.error("a run", FAIL.observed)])
def test_what_is_only_shown_makes_no_test_fail(finding):
    text = rendered(lambda: judged([Told("node"), Told("silence", finding, points=0)]))
    jenkins().validate(text)
    (suite,) = ET.fromstring(text)
    assert [suite.get(key) for key in ("failures", "errors", "skipped")] == ["0", "0", "1"]
    (shown,) = suite.iter("skipped")
    assert shown.get("type") == "no points"
    assert shown.get("message") == f"Title of silence: {FAIL.observed}"


def test_a_failure_says_what_to_try():
    root = ET.fromstring(rendered(lost_points))
    failure = next(root.iter("failure"))
    assert failure.get("message") == (
        "It publishes every 300 ms: a median of 322.4 ms; 2 of 3 periods are longer than 315 ms, "
        "the longest is 612 ms"
    )
    assert "try next: The period grows with the work in the callback." in failure.text
    assert "printed: loop took 0.31 s" in failure.text
    assert "where: src/bot_publisher/bot_publisher/node.py:18: time.sleep(0.3)" in failure.text


def test_points_are_properties_of_the_suite_and_its_time_has_no_offset():
    root = ET.fromstring(rendered(lost_points))
    assert root[0].get("timestamp") == "2026-03-04T09:12:33"
    properties = {item.get("name"): item.get("value") for item in root.iter("property")}
    assert properties["points.period"] == "1.02 / 3"
    assert (properties["score"], properties["max_score"]) == ("3.02", "7")


def test_limits_and_remarks_are_reported_once_and_cost_nothing():
    root = ET.fromstring(rendered(reached_limits))
    (said,) = root.iter("system-out")
    lines = said.text.splitlines()
    assert lines[:2] == [
        "Limits of the sandbox that were reached:",
        "scenario listen: its processes took 1056 MiB of memory, 1024 MiB are allowed",
    ]
    assert lines[2] == "Worth knowing:"
    assert lines[-1] == "10 more: see the report"
    # The escape sequence that is part of each name is gone.
    assert lines[3].startswith("scenario listen: a node of the submission is called `/bot_0/rosgr")
    assert len(lines) == 24
    assert root.get("failures") == "0"
    assert not list(ET.fromstring(rendered(full_points)).iter("system-out"))


def test_xunit1_has_the_student_s_file_and_line_which_jenkins_forbids():
    text = rendered(lost_points, xunit1=True)
    cases = cases_of(text)
    assert cases["period"].get("file") == "src/bot_publisher/bot_publisher/node.py"
    assert cases["period"].get("line") == "18"
    properties = {item.get("name"): item.get("value") for item in cases["period"].iter("property")}
    assert properties["points"] == "1.02 / 3"
    assert not jenkins().is_valid(text)


@pytest.mark.parametrize(
    ("name", "code", "said"),
    [
        ("full points", 0, "2 tests, 0 errors, 0 failures, 0 skipped"),
        ("lost points", 1, "4 tests, 0 errors, 1 failure, 1 skipped"),
        ("not graded", 1, "3 tests, 2 errors, 0 failures, 0 skipped"),
    ],
)
def test_colcon_counts_the_same(name, code, said, tmp_path):
    (tmp_path / "rosgrade.xml").write_text(rendered(SAMPLES[name]), encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-m", "colcon", "test-result", "--test-result-base", str(tmp_path)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={"PATH": "/usr/bin:/bin", "COLCON_HOME": str(tmp_path), "HOME": str(tmp_path)},
        check=False,
    )
    assert ended.returncode == code, ended.stderr
    assert said in ended.stdout
