"""Named sets, ``.repos`` files and folders of packages."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.errors import AssignmentError, UsageError
from grader.submission.underlay.definition import (
    find_underlay,
    named_sets,
    sets_with,
    ways_to_get,
)

REPOSITORY = "repositories:\n  a/b:\n    type: git\n    url: https://example.org/b.git\n"


def test_the_named_sets_are_those_that_courses_need() -> None:
    assert named_sets() == ("ament_cmake_auto", "launch", "rclcpp", "ros2cli", "tf2")


@pytest.mark.parametrize("name", named_sets())
def test_a_named_set_pins_every_commit_and_lists_what_is_built(name: str) -> None:
    repos = find_underlay(name).repos
    assert repos is not None
    for repository in repos.repositories.values():
        assert repository.commit and repository.packages
    assert set(repos.requires) <= set(named_sets()) - {name}


def test_the_name_of_a_set_comes_before_a_folder_of_that_name(tmp_path: Path) -> None:
    (tmp_path / "tf2").mkdir()
    assert find_underlay("tf2", tmp_path).folder is None
    assert find_underlay("./tf2", tmp_path).folder == tmp_path / "tf2"


def test_a_file_in_the_format_of_vcstool_is_named_by_its_path(tmp_path: Path) -> None:
    (tmp_path / "course.repos").write_text(f"{REPOSITORY}    version: 1.0.0\n")
    underlay = find_underlay("course.repos", tmp_path)
    assert underlay.name == "course"
    assert underlay.given == str(tmp_path / "course.repos")
    assert underlay.repos is not None
    assert underlay.repos.repositories["a/b"].version == "1.0.0"
    assert not underlay.listed


def test_a_repository_without_a_version_is_refused_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "course.repos"
    file.write_text(REPOSITORY)
    with pytest.raises(AssignmentError, match=r"course\.repos:2: .*version"):
        find_underlay("course.repos", tmp_path)


def test_an_unknown_name_is_told_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no underlay 'tf'\. Did you mean 'tf2'\?"):
        find_underlay("tf", tmp_path)


def test_the_set_that_has_a_package_is_found() -> None:
    assert [one.name for one in sets_with({"tf2_ros_py", "turtlesim"})] == ["tf2"]
    assert sets_with({"turtlesim"}) == []


def test_what_students_choose_needs_a_command_and_the_rest_an_entry_of_the_assignment() -> None:
    assert ways_to_get({"rclcpp"}) == "`rosgrade underlay add rclcpp` on that machine"
    assert ways_to_get({"tf2_ros_py"}) == "`underlays: [tf2]` in assignment.yaml"
    assert ways_to_get({"turtlesim"}) == ""
