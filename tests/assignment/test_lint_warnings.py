"""What is valid in an assignment, but looks like a mistake."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.assignment.lint_warnings import lint_warnings
from grader.assignment.load import list_assignments, load_assignment
from tests.assignment.lessons import HEAD


@pytest.mark.parametrize("name", list_assignments())
def test_what_is_shipped_leaves_no_doubt(name: str) -> None:
    assert [one for one in lint_warnings(load_assignment(name), None) if "mutants" not in one] == []


def all_told(folder: Path, checks: str, depends: str = "") -> list[str]:
    (folder / "lesson").mkdir()
    text = HEAD.replace("executables:", f"depends: [{depends}]\n    executables:") + checks
    (folder / "lesson" / "assignment.yaml").write_text(text, encoding="utf-8")
    loaded = load_assignment(folder / "lesson")
    return [one for one in lint_warnings(loaded, []) if not one.startswith("no mutant")]


def test_a_misspelt_dependency_is_reported_and_an_unknown_one_is_not(
    tmp_path: Path,
) -> None:
    check = "  - {id: some, uses: node.alive, points: 1}\n"
    known = "rclpy, geometry_msgs, python3-numpy, bot, our_own_drivers_of_2024"
    assert all_told(tmp_path, check, f"{known}, geometry_msg, rospy") == [
        "the package 'bot' depends on 'geometry_msg', which is not known as a package of "
        "ROS 2 Jazzy or a rosdep key. Did you mean 'geometry_msgs'?",
        "the package 'bot' depends on 'rospy', which is not known as a package of "
        "ROS 2 Jazzy or a rosdep key.",
    ]
