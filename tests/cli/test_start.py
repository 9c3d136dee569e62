"""`rosgrade start` and `rosgrade new`: what they write builds, runs, and is graded as it must."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from grader.machine import ros
from tests.cli.conftest import Rosgrade


def statuses(folder: Path) -> dict[str, str]:
    (file,) = (folder / "rosgrade-report").glob("*/result.json")
    text = file.read_text(encoding="utf-8")
    return {check["id"]: check["status"] for check in json.loads(text)["checks"]}


@pytest.mark.ros
def test_a_starter_builds_and_runs_but_solves_nothing(rosgrade: Rosgrade, tmp_path: Path) -> None:
    started = rosgrade("start", "timed_publisher")
    assert started.returncode == 0, started.stderr
    assert "rosgrade watch timed_publisher ." in started.stdout
    ended = rosgrade("check", "timed_publisher", ".")
    assert ended.returncode == 1, ended.stdout + ended.stderr
    found = statuses(tmp_path)
    works = {"package", "builds", "dependencies", "executable", "starts", "alive", "ends"}
    assert {found[name] for name in works} == {"passed"}
    assert found["topic"] == "failed"
    assert found["period"] == "skipped"


@pytest.mark.compiles
@pytest.mark.ros
@pytest.mark.slow
def test_a_starter_with_an_interface_generates_it(rosgrade: Rosgrade, tmp_path: Path) -> None:
    rosgrade("start", "custom_interface", "src")
    rosgrade("check", "custom_interface", "src", "--only", "builds", "--only", "fields")
    found = statuses(tmp_path)
    assert (found["generated"], found["builds"]) == ("passed", "passed")
    assert found["fields"] == "failed"


def test_a_start_in_cpp_says_first_what_this_machine_lacks(
    rosgrade: Rosgrade, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    started = rosgrade("start", "timed_publisher", "--cpp", "my ws/src")
    if ros.is_sourced(os.environ):
        pytest.skip("a sourced ROS has rclcpp")
    warning = " ".join(started.stderr.split())
    assert "before C++ can be built here: rosgrade underlay add rclcpp" in warning
    assert "rosgrade watch timed_publisher 'my ws'\n" in started.stdout


def test_a_file_that_is_there_is_never_overwritten(rosgrade: Rosgrade, tmp_path: Path) -> None:
    rosgrade("start", "timed_publisher", "src")
    node = tmp_path / "src" / "bot_publisher" / "bot_publisher" / "bot_publisher.py"
    node.write_text("mine")
    again = rosgrade("start", "timed_publisher", "src")
    assert again.returncode == 2
    assert "is there already, and is left as it is" in again.stderr
    assert node.read_text() == "mine"
    rosgrade("new", "lesson")
    again = rosgrade("new", "lesson")
    assert again.returncode == 2
    assert "lesson is there already" in again.stderr


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("My-Lesson", "is not an id: use lower case letters"),
        ("time", "is a name of Python's own"),
        ("rclpy", "a package of ROS, which the assignment's package would hide"),
    ],
)
def test_a_name_that_cannot_be_is_refused(rosgrade: Rosgrade, name: str, said: str) -> None:
    ended = rosgrade("new", name)
    assert ended.returncode == 2
    assert said in ended.stderr


def test_a_new_assignment_is_valid_and_leaves_no_doubt(rosgrade: Rosgrade, tmp_path: Path) -> None:
    written = rosgrade("new", "lesson", "course")
    assert written.returncode == 0, written.stderr
    ended = rosgrade("validate", tmp_path / "course" / "lesson")
    assert ended.returncode == 0
    assert ended.stdout.endswith("1 scenario, 9 checks, 28 mutants: valid\n")
    assert ended.stderr == ""
    rosgrade("new", "both", "--cpp")
    ended = rosgrade("validate", "both")
    assert ended.returncode == 0 and ended.stderr == ""
    assert ended.stdout.endswith("1 scenario, 9 checks, 56 mutants: valid\n")


@pytest.mark.parametrize("name", ["course/lesson", "./course/lesson/", "{here}/course/lesson"])
def test_a_new_assignment_is_named_by_its_folder_as_well(
    rosgrade: Rosgrade, tmp_path: Path, name: str
) -> None:
    written = rosgrade("new", name.format(here=tmp_path))
    assert written.returncode == 0, written.stderr
    assert rosgrade("validate", tmp_path / "course" / "lesson").returncode == 0
    assert rosgrade("new", "course/My-Lesson").returncode == 2


def test_the_handout_is_written_as_a_page(rosgrade: Rosgrade, tmp_path: Path) -> None:
    ended = rosgrade("show", "timed_publisher", "--html")
    assert ended.stdout == "Handout: timed_publisher.html\n"
    assert "A message comes every 300 ms" in (tmp_path / "timed_publisher.html").read_text()
    rosgrade("show", "timed_publisher", "--html", "-o", "page/handout.html")
    assert (tmp_path / "page" / "handout.html").is_file()
    wrong = rosgrade("show", "timed_publisher", "-o", "x.html")
    assert wrong.returncode == 2 and "add --html" in wrong.stderr


@pytest.mark.parametrize("command", ["start", "watch", "check", "show", "new"])
def test_every_command_explains_itself(rosgrade: Rosgrade, command: str) -> None:
    ended = rosgrade(command, "--help", columns=80)
    assert ended.returncode == 0
    assert f" {command} [OPTIONS]" in ended.stdout.splitlines()[0]
    assert max(map(len, ended.stdout.splitlines())) <= 80
