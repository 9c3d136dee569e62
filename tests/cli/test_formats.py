"""The formats by the real command: what is written, and what students never see."""

from __future__ import annotations

import csv
import gzip
import json
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from mcap.reader import make_reader

from grader.report.model.result import make_result, result_json
from tests.cli.conftest import ROOT, Rosgrade
from tests.report.sample import full_points, lost_points, not_graded

REFERENCE = ROOT / "reference" / "timed_publisher"
ASSIGNMENT = """\
rosgrade: 1
id: lesson
title: A lesson with a secret
packages:
  - {name: bot_publisher, executables: [bot_pub]}
scenarios:
  - id: seen
    launch: [{executable: bot_pub}]
    record: [{topic: /cmd_vel, type: geometry_msgs/msg/Twist}]
    until: {messages: 2}
    timeout: 5 s
  - id: zqhard
    launch: [{executable: bot_pub}]
    record: [{topic: /cmd_vel, type: geometry_msgs/msg/Twist}]
    until: {messages: 2}
    timeout: 5 s
checks:
  - {id: starts, uses: node.starts, scenarios: [seen], points: 1}
  - id: named
    title: The node is called robby
    uses: node.exists
    with: {name: robby}
    scenarios: [seen]
    requires: [starts]
    points: 2
  - id: zqsecret
    title: zqtitle
    hint: zqhint
    uses: topic.published
    with: {topic: /cmd_vel}
    scenarios: [zqhard]
    requires: [starts]
    points: 3
    visibility: hidden
"""


def lesson(folder: Path) -> Path:
    place = folder / "lesson"
    place.mkdir()
    (place / "assignment.yaml").write_text(ASSIGNMENT, encoding="utf-8")
    return place


def recorded(file: Path) -> Iterator[str]:
    """All facts of a recording, whose file is compressed."""
    with file.open("rb") as stream:
        reader = make_reader(stream)
        for one in reader.iter_attachments():
            data = gzip.decompress(one.data) if one.name.endswith(".gz") else one.data
            yield f"{one.name} {data.decode()}"
        yield from (str(metadata) for metadata in reader.iter_metadata())


@pytest.mark.ros
def test_a_student_s_run_announces_what_is_hidden_and_leaks_nothing(
    rosgrade: Rosgrade, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = lesson(tmp_path)
    monkeypatch.setenv("GITHUB_WORKSPACE", str(ROOT))
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    monkeypatch.setenv("GITHUB_OUTPUT", str(tmp_path / "output"))
    report = tmp_path / "out" / "report"
    files = {name: tmp_path / "out" / name for name in ("junit.xml", "comment.md", "results.json")}
    ended = rosgrade(
        *("check", place, REFERENCE, "--github", "--keep", "--report", report),
        *("--junit", files["junit.xml"], "--markdown", files["comment.md"]),
        *("--gradescope", files["results.json"]),
    )
    assert ended.returncode == 1, ended.stdout + ended.stderr

    lines = ended.stdout.splitlines()
    stopped = re.fullmatch(r"::stop-commands::(\w{32})", lines[0])
    assert stopped
    resumed = lines.index(f"::{stopped[1]}::")
    assert [line.partition(" ")[0] for line in lines[resumed + 1 :]] == ["::error"]
    assert not [line for line in lines[1:resumed] if line.startswith("::")]
    assert "1 check failed; 1 hidden check, 3 points, runs at grading." in ended.stdout

    assert sorted(file.name for file in (report / "recordings").iterdir()) == [
        *("foxglove-layout.json", "seen.mcap", "submission.json")
    ]
    assert (report / "install" / "lib" / "bot_publisher" / "bot_pub").is_file()
    assert len(list(ET.parse(files["junit.xml"]).iter("testcase"))) == 2
    assert json.loads(files["results.json"].read_text())["score"] == 1
    assert "status<<" in (tmp_path / "output").read_text()
    assert "## lesson: 1 of 3 points" in (tmp_path / "summary.md").read_text(encoding="utf-8")
    texts = [ended.stdout, ended.stderr]
    for file in [*report.rglob("*"), *files.values(), tmp_path / "summary.md", tmp_path / "output"]:
        if file.suffix == ".mcap":
            texts += recorded(file)
        elif file.is_file() and "install" not in file.parts:
            texts.append(file.read_bytes().decode(errors="replace"))
    assert any(text.startswith("endpoints") and "/cmd_vel" in text for text in texts)
    assert not [text for text in texts if "zq" in text]

    again = rosgrade("report", report, place, "--junit", tmp_path / "again.xml")
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "again.xml").read_text() == files["junit.xml"].read_text()
    html = (report / "report.html").read_text(encoding="utf-8")
    assert "zq" not in html and "1 hidden check, 3 points, runs at grading" in html

    regraded = rosgrade("regrade", report, place)
    assert regraded.returncode == 1, regraded.stdout
    assert "zq" not in regraded.stdout and "no check changed" in regraded.stdout

    (place / "assignment.yaml").write_text(ASSIGNMENT.replace("points: 2", "points: 4"))
    changed = rosgrade("report", report, place)
    assert changed.returncode == 2
    assert "the assignment has changed since this was graded" in changed.stderr


@pytest.mark.ros
def test_an_instructor_s_run_judges_everything(rosgrade: Rosgrade, tmp_path: Path) -> None:
    results = tmp_path / "results.json"
    ended = rosgrade("check", lesson(tmp_path), REFERENCE, "--hidden", "--gradescope", results)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    assert "Score: 4 of 6 points" in ended.stdout
    data = json.loads(results.read_text(encoding="utf-8"))
    assert data["score"] == 4
    assert [test["visibility"] for test in data["tests"]] == ["visible", "visible", "hidden"]
    assert "zq" not in data["output"]

    report = tmp_path / "rosgrade-report" / "lesson"
    assert "zqtitle" in (report / "report.html").read_text(encoding="utf-8")
    copy = report / "student-report.html"
    assert "1 hidden check, 3 points, runs at grading" in copy.read_text(encoding="utf-8")
    assert "zq" not in copy.read_text(encoding="utf-8")
    copy.unlink()
    again = rosgrade("report", report, tmp_path / "lesson")
    assert again.returncode == 0, again.stderr
    assert copy.is_file()


def test_what_could_not_even_begin_says_that_grading_did_not_finish(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    results = tmp_path / "results" / "results.json"
    ended = rosgrade("check", "timed_publisher", "nothing.zip", "--gradescope", results)
    assert ended.returncode == 2
    assert "Grading did not finish" in json.loads(results.read_text())["output"]


def test_commands_to_github_are_resumed_after_an_error(rosgrade: Rosgrade) -> None:
    ended = rosgrade("check", "timed_publisher", "nothing.zip", "--github")
    first, last = ended.stdout.splitlines()
    assert first.removeprefix("::stop-commands::") == last.strip(":")


def test_classroom50_must_have_started_it(
    rosgrade: Rosgrade, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CLASSROOM", raising=False)
    ended = rosgrade("check", "timed_publisher", ".", "--classroom50")
    assert ended.returncode == 2
    assert "not started by Classroom 50: the environment lacks CLASSROOM" in ended.stderr


def batch(folder: Path) -> Path:
    """The output folder of a class of three, of whom a fourth is being written."""
    unfinished = folder / "class" / ".partial" / "dee"
    unfinished.mkdir(parents=True)
    (unfinished / "result.json").write_text("{")
    for name, make in (("90211", full_points), ("bob", lost_points), ("cy", not_graded)):
        sample = make()
        result = make_result(sample.grade, sample.recordings, sample.facts)
        named = result.submission.model_copy(update={"id": name})
        place = folder / "class" / name
        place.mkdir(parents=True)
        text = result_json(result.model_copy(update={"submission": named}))
        (place / "result.json").write_text(text, encoding="utf-8")
    return folder / "class"


def test_gradebooks_are_made_from_a_class(rosgrade: Rosgrade, tmp_path: Path) -> None:
    out = batch(tmp_path)
    ended = rosgrade("export", "csv", out, "-o", tmp_path / "grades.csv")
    assert ended.returncode == 0, ended.stderr
    with (tmp_path / "grades.csv").open(encoding="utf-8", newline="") as stream:
        read = list(csv.DictReader(stream))
    assert [(row["submission"], row["score"]) for row in read] == [
        *(("90211", "3"), ("bob", "3.02"), ("cy", ""))
    ]

    export = tmp_path / "export.csv"
    export.write_text(
        "Student,ID,SIS Login ID,Section,Lesson (7)\n"
        '"Lopez, Ana",90211,ana,S,\n"Ray, Bob",90212,bob,S,\n'
    )
    ended = rosgrade(
        *("export", "canvas", out, "--canvas", export, "-o", tmp_path / "canvas.csv"),
        *("--column", "Lesson"),
    )
    assert ended.returncode == 1
    assert "2 scores" in ended.stdout
    assert "cy: not matched, no student of that name or number in the gradebook" in ended.stderr
    with (tmp_path / "canvas.csv").open(encoding="utf-8", newline="") as stream:
        assert [row["Lesson (7)"] for row in csv.DictReader(stream)] == ["7", "3", "3.02"]


def test_a_gradebook_that_is_none_is_named(rosgrade: Rosgrade, tmp_path: Path) -> None:
    (tmp_path / "roster.csv").write_text("name,score\n")
    ended = rosgrade("export", "canvas", batch(tmp_path), "--canvas", tmp_path / "roster.csv")
    assert ended.returncode == 2
    assert "not a gradebook of Canvas" in ended.stderr
    assert not (tmp_path / "canvas.csv").exists()


def test_a_file_for_one_report_is_refused_for_a_class(rosgrade: Rosgrade, tmp_path: Path) -> None:
    ended = rosgrade("report", batch(tmp_path), "--junit", tmp_path / "x.xml")
    assert ended.returncode == 2
    assert "give the folder of one report" in ended.stderr
