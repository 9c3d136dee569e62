"""Wrong use ends with one clear message, exit code 2, and no traceback."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import ROOT, Rosgrade

ASSIGNMENT = """\
rosgrade: 1
id: {folder}
title: Test
packages:
  - name: bot
    executables: [bot]
scenarios:
  - id: run
    launch: [{{executable: bot}}]
    record: [{{topic: /cmd_vel, type: geometry_msgs/msg/Twist}}]
    timeout: 5 s
checks:
  - id: alive
    uses: node.alive
    points: 1
"""


def lesson(folder: Path, old: str = "", new: str = "") -> Path:
    """An assignment with one thing changed."""
    place = folder / "lesson"
    place.mkdir()
    text = ASSIGNMENT.format(folder="lesson").replace(old, new)
    (place / "assignment.yaml").write_text(text, encoding="utf-8")
    return place


MISTAKES = (
    ("    points: 1", "    poinst: 1", 15, "unknown key 'poinst'. Did you mean 'points'?"),
    ("uses: node.alive", "uses: node.alife", 14, "Did you mean 'node.alive'?"),
    ("timeout: 5 s", "timeout: 5 m", 11, "'m' is a unit of length, but a time is needed"),
    ("timeout: 5 s", "timeout: 5", 11, "has no unit: write for example '5 s'"),
    ("title: Test", "title: Test\ntitle: Again", 4, "the key 'title' stands twice"),
    ("/cmd_vel", "cmd_vel", 10, "is relative: write the full name, '/cmd_vel'"),
)


def test_mistakes_in_the_yaml_are_named_with_their_lines(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    places = []
    for number, (old, new, _, _) in enumerate(MISTAKES):
        (tmp_path / str(number)).mkdir()
        places.append(lesson(tmp_path / str(number), old, new))
    ended = rosgrade("validate", *places, columns=500)
    for place, (_, _, line, said) in zip(places, MISTAKES, strict=True):
        told = [one for one in ended.stderr.splitlines() if f"{place}/assignment.yaml:" in one]
        assert [f"assignment.yaml:{line}: " in one and said in one for one in told] == [True]
    for one in (ended, rosgrade("check", places[0], tmp_path)):
        assert one.returncode == 2
        assert "assignment.yaml:15: " in one.stderr and MISTAKES[0][3] in one.stderr
        assert "Traceback" not in one.stderr
    assert not (tmp_path / "rosgrade-report").exists()


def test_an_assignment_that_does_not_exist_names_the_nearest(rosgrade: Rosgrade) -> None:
    ended = rosgrade("check", "timed_publsher", ".")
    assert ended.returncode == 2
    assert "Did you mean 'timed_publisher'?" in ended.stderr


def test_the_submissions_of_a_class_are_named_by_their_folder(rosgrade: Rosgrade) -> None:
    ended = rosgrade("batch", "timed_publisher", "class/ana", "class/ben", "--out", "results")
    assert ended.returncode == 2
    told = " ".join(ended.stderr.split())
    assert "batch takes one folder, not 2 submissions: give their folder" in told


@pytest.mark.parametrize(
    "arguments",
    [
        ("check", "mine", "timed_publisher"),
        ("check", "mine"),
        ("watch", "mine"),
        ("start", "mine"),
        ("batch", "mine", "--out", "results"),
    ],
)
def test_a_submission_in_the_place_of_the_assignment_is_named_as_one(
    rosgrade: Rosgrade, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    (tmp_path / "mine" / "src" / "bot").mkdir(parents=True)
    (tmp_path / "mine" / "src" / "bot" / "package.xml").touch()
    ended = rosgrade(*arguments)
    assert ended.returncode == 2
    assert "mine is a folder with the package bot, such as a submission; " in ended.stderr
    assert "the first argument is an assignment, such as bot_controller\n" in ended.stderr


@pytest.mark.parametrize(
    ("name", "seen"),
    [
        ("mine.zip", "an archive"),
        ("run.mcap", "a recording"),
        ("results", "a folder with results"),
        ("empty", "a folder without an assignment.yaml"),
    ],
)
def test_what_stands_in_the_place_of_the_assignment_is_named(
    rosgrade: Rosgrade, tmp_path: Path, name: str, seen: str
) -> None:
    for folder in ("results", "empty"):
        (tmp_path / folder).mkdir()
    for file in ("mine.zip", "run.mcap", "results/result.json"):
        (tmp_path / file).touch()
    ended = rosgrade("check", name)
    assert ended.returncode == 2
    assert f"{name} is {seen}; the first argument is an assignment" in ended.stderr


def test_a_submission_in_the_place_of_a_recording_is_named(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    (tmp_path / "mine").mkdir()
    ended = rosgrade("replay", "mine", "run.mcap")
    assert ended.returncode == 2
    assert "; the first argument is a recording, such as recordings/run.mcap" in ended.stderr


def test_an_own_assignment_and_a_folder_of_its_name_are_the_assignment(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    (tmp_path / "timed_publisher").mkdir()
    for name in ("timed_publisher", lesson(tmp_path)):
        assert rosgrade("show", name).returncode == 0


def test_a_file_that_is_a_dash_is_standard_output_and_nothing_else_is_in_it(
    rosgrade: Rosgrade,
) -> None:
    shown = rosgrade("show", "timed_publisher", "--html", "--out", "-")
    assert shown.returncode == 0
    assert shown.stdout.startswith("<!doctype html>") and shown.stdout.endswith("</html>")
    assert shown.stderr == "Handout: -\n"


def test_one_output_alone_goes_to_standard_output(rosgrade: Rosgrade) -> None:
    ended = rosgrade("check", "timed_publisher", ".", "--json", "-", "--junit", "-")
    assert ended.returncode == 2
    assert "-: is given for two outputs" in ended.stderr


def test_a_submission_that_does_not_exist_is_named(rosgrade: Rosgrade) -> None:
    ended = rosgrade("check", "timed_publisher", "homework.zip")
    assert ended.returncode == 2
    assert "homework.zip" in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("option", "name", "said"),
    [("--only", "periode", "'period'"), ("--scenario", "rum", "'run'")],
)
def test_a_part_that_does_not_exist_names_the_nearest(
    rosgrade: Rosgrade, option: str, name: str, said: str
) -> None:
    ended = rosgrade("check", "timed_publisher", ".", option, name)
    assert ended.returncode == 2
    assert f"Did you mean {said}?" in ended.stderr


def test_another_distribution_in_the_shell_is_not_the_student_s_fault(
    rosgrade: Rosgrade, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DISTRO", "humble")
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/humble")
    ended = rosgrade("check", "timed_publisher", ROOT / "reference" / "timed_publisher")
    assert ended.returncode == 3
    assert "ROS 2 humble is sourced" in ended.stderr


def test_a_file_in_the_place_of_the_report_is_reported_before_anything_is_graded(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    (tmp_path / "mine").touch()
    (tmp_path / "class").mkdir()
    said = "mine: is not a folder; use another place"
    for arguments in (
        ("check", "timed_publisher", ROOT / "reference" / "timed_publisher", "--report", "mine"),
        ("batch", "timed_publisher", "class", "--out", "mine", "--sandbox", "none"),
        ("start", "timed_publisher", "mine"),
    ):
        ended = rosgrade(*arguments)
        assert ended.returncode == 2
        assert said in ended.stderr
        assert "building" not in ended.stderr


def test_a_library_that_is_not_there_is_a_doubt(rosgrade: Rosgrade, tmp_path: Path) -> None:
    ended = rosgrade("validate", lesson(tmp_path, "title: Test", "title: Test\nlibraries: [scypi]"))
    assert ended.returncode == 0
    assert "warning" in ended.stderr
    assert "'scypi', which is not installed here. Did you mean 'scipy'?" in ended.stderr


def test_every_assignment_of_rosgrade_is_valid(rosgrade: Rosgrade) -> None:
    names = [folder.name for folder in sorted((ROOT / "assignments").iterdir())]
    ended = rosgrade("validate", *names, columns=300)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.count(": valid") == len(names)


def test_the_lists_and_the_catalogue_are_printed(rosgrade: Rosgrade) -> None:
    assert "timed_publisher" in rosgrade("list").stdout
    assert "/cmd_vel" in rosgrade("show", "timed_publisher").stdout
    assert "timing.period" in rosgrade("checks").stdout
    assert "tolerance" in rosgrade("checks", "timing.period").stdout
    ended = rosgrade("checks", "timing.perod")
    assert ended.returncode == 2
    assert "Did you mean 'timing.period'?" in ended.stderr


def test_the_rules_of_a_course_are_checked_like_an_assignment(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    file = tmp_path / "course.yaml"
    text = "title: Robotics\ntime_zone: UTC\nassignments: {qos: {due: 2026-10-12 23:59}}\n"
    file.write_text(text)
    assert rosgrade("validate", file).stdout == f"{file}: rules of 1 assignment: valid\n"
    file.write_text(text + "grups: team\n")
    ended = rosgrade("validate", file)
    assert ended.returncode == 2
    assert f"{file}:4: grups: unknown key 'grups'. Did you mean 'groups'?" in ended.stderr
    (tmp_path / "class").mkdir()
    place = ("--course", file, "--out", tmp_path / "out", "--sandbox", "none")
    file.write_text(text)
    ended = rosgrade("batch", "quaternion", tmp_path / "class", *place)
    assert ended.returncode == 2
    assert f"{file}: has no assignment 'quaternion'. There are: qos." in ended.stderr


@pytest.mark.parametrize("document", ["assignment", "mutants", "course", "result"])
def test_the_schemas_are_json_schemas(rosgrade: Rosgrade, document: str) -> None:
    import json

    schema = json.loads(rosgrade("schema", document).stdout)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert schema["$id"] == f"urn:rosgrade:schema:{document}:1"
    if document == "result":
        assert schema["properties"]["schema"]["const"] == 1
    assert schema["$defs"]


@pytest.mark.parametrize("jobs", ["0", "²"])
def test_a_number_of_jobs_that_is_none_is_reported(
    rosgrade: Rosgrade, tmp_path: Path, jobs: str
) -> None:
    place = lesson(tmp_path)
    ended = rosgrade("batch", place, tmp_path, "--out", tmp_path / "out", f"--jobs={jobs}")
    assert ended.returncode == 2
    assert "must be auto, or 1 or more" in ended.stderr and "Traceback" not in ended.stderr


PRESSED = """
import sys
from grader.__main__ import main
class Pressed:
    def find_spec(name, *_):
        if name == "grader.cli.app":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Pressed)
main()
"""


def test_ctrl_c_at_the_very_start_ends_it_without_a_traceback() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", PRESSED], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")
