"""Named sets, ``.repos`` files and folders of packages."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.errors import AssignmentError, UsageError
from grader.submission.read.rosdistro import PACKAGES
from grader.submission.underlay.definition import (
    SETS,
    find_underlay,
    providers,
    ways_to_get,
)

REPOSITORY = "repositories:\n  a/b:\n    type: git\n    url: https://example.org/b.git\n"


def test_every_set_stands_for_packages_of_ros() -> None:
    assert set(SETS) == {"ament_cmake_auto", "launch", "rclcpp", "ros2cli", "tf2"}
    assert {name for listed in SETS.values() for name in listed} <= PACKAGES


def test_any_package_is_named_as_in_ros() -> None:
    assert find_underlay("rclcpp_action").packages == ("rclcpp_action",)
    # The index decides, where it is there; this list is not whole.
    assert find_underlay("some_new_driver").packages == ("some_new_driver",)
    with pytest.raises(UsageError, match=r"no underlay 'Some/Driver'\. The usual ones are: "):
        find_underlay("Some/Driver")


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


def test_one_command_gets_what_is_lacking_by_the_smallest_sets() -> None:
    assert ways_to_get({"rclcpp"}) == "`rosgrade underlay add rclcpp` on that machine"
    lacking = {"tf2_ros_py", "rclcpp_action", "ros2run"}
    assert ways_to_get(lacking) == (
        "`rosgrade underlay add rclcpp_action ros2cli tf2` on that machine"
    )
    assert ways_to_get({"g++"}) == ""


def test_a_module_is_named_by_the_package_that_has_it() -> None:
    assert providers({"tf2_ros"}) == {"tf2_ros", "tf2_ros_py"}
