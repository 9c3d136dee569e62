"""What is valid in an assignment, but looks like a slip."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.assignment.lint_warnings import lint_warnings
from grader.assignment.load import list_assignments, load_assignment
from tests.assignment.lessons import HEAD


def told(folder: Path, run: str, uses: str) -> list[str]:
    (folder / "lesson").mkdir()
    check = f"  - {{id: some, uses: {uses}, points: 1}}\n"
    text = HEAD.replace("timeout: 5 s", f"timeout: 5 s\n    {run}") + check
    (folder / "lesson" / "assignment.yaml").write_text(text, encoding="utf-8")
    loaded = load_assignment(folder / "lesson")
    return [
        doubt for doubt in lint_warnings(loaded, []) if doubt.startswith("the check 'some' needs")
    ]


@pytest.mark.parametrize(
    ("run", "uses", "doubt"),
    [
        (
            "until: {messages: 3}",
            "messages.count, with: {topic: /cmd_vel, at_least: 4}",
            "needs 4 messages, but the scenario 'run' ends after 3 messages",
        ),
        (
            "until: {messages: 5}",
            "timing.period, with: {topic: /cmd_vel, period: 300 ms}",
            "needs 6 messages, one every 300 ms, but the scenario 'run' ends after 5 messages",
        ),
        (
            "until: {elapsed: 4 s}",
            "timing.period, with: {topic: /cmd_vel, period: 2 s}",
            "needs 6 messages, one every 2 s, but the scenario 'run' ends after 5 s",
        ),
    ],
)
def test_a_run_that_ends_too_soon_for_its_check_is_told(
    tmp_path: Path, run: str, uses: str, doubt: str
) -> None:
    assert told(tmp_path, run, uses) == [f"the check 'some' {doubt}"]


@pytest.mark.parametrize(
    ("run", "uses"),
    [
        ("until: {messages: 4}", "messages.count, with: {topic: /cmd_vel, at_least: 4}"),
        ("until: {messages: 1, quiet: 2 s}", "messages.count, with: {topic: /cmd_vel, exactly: 2}"),
        ("until: {elapsed: 4 s}", "messages.count, with: {topic: /cmd_vel, at_most: 100}"),
    ],
)
def test_a_run_that_may_go_on_is_not_doubted(tmp_path: Path, run: str, uses: str) -> None:
    assert told(tmp_path, run, uses) == []


@pytest.mark.parametrize("name", list_assignments())
def test_what_is_shipped_leaves_no_doubt(name: str) -> None:
    assert [one for one in lint_warnings(load_assignment(name), None) if "mutants" not in one] == []


def all_told(folder: Path, checks: str, depends: str = "") -> list[str]:
    (folder / "lesson").mkdir()
    text = HEAD.replace("executables:", f"depends: [{depends}]\n    executables:") + checks
    (folder / "lesson" / "assignment.yaml").write_text(text, encoding="utf-8")
    loaded = load_assignment(folder / "lesson")
    return [one for one in lint_warnings(loaded, []) if not one.startswith("no mutant")]


def test_a_dependency_that_is_a_slip_is_told_and_one_that_is_merely_unknown_is_not(
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
