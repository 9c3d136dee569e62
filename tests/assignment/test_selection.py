"""A part of an assignment: for students, the visible one."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.assignment.lint_warnings import lint_warnings
from grader.assignment.load import load_assignment
from grader.assignment.model import Withheld
from grader.assignment.selection import select, visible_part
from grader.errors import AssignmentError, UsageError
from tests.assignment.lessons import HEAD

CHECKS = """\
  - {id: alive, uses: node.alive, points: 1}
  - {id: ends, uses: node.starts, points: 1.5, requires: [alive], visibility: hidden}
  - {id: starts, uses: node.starts, points: 2, visibility: after_due_date, scenarios: [hard]}
"""
HARD = """\
  - id: hard
    launch: [{executable: bot_pub}]
    record: [{topic: /cmd_vel, type: geometry_msgs/msg/Twist}]
    timeout: 5 s
"""


def lesson(folder: Path, checks: str = CHECKS):
    (folder / "lesson").mkdir()
    text = HEAD.replace("checks:\n", f"{HARD}checks:\n") + checks
    (folder / "lesson" / "assignment.yaml").write_text(text, encoding="utf-8")
    return load_assignment(folder / "lesson")


def test_the_visible_part_has_nothing_of_the_rest_but_number_and_points(tmp_path):
    whole = lesson(tmp_path)
    part = visible_part(whole)
    assert [bound.spec.id for bound in part.checks] == ["alive"]
    assert [spec.id for spec in part.assignment.checks] == ["alive"]
    assert part.withheld == Withheld(checks=2, points=3.5)
    assert part.sha256 == whole.sha256


def test_scenarios_of_hidden_checks_alone_are_not_run_for_students(tmp_path):
    checks = CHECKS.replace("points: 1}", "points: 1, scenarios: [run]}", 1)
    assert [one.id for one in visible_part(lesson(tmp_path, checks)).assignment.scenarios] == [
        "run"
    ]


def test_each_run_of_a_repeated_scenario_is_a_scenario(tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), "HARD", HARD.replace("id: hard\n", "id: hard\n    repeat: 2\n"))
    whole = lesson(tmp_path)
    assert [one.id for one in whole.assignment.scenarios] == ["run", "hard_1", "hard_2"]
    judged = {bound.spec.id: whole.scenarios_of(bound) for bound in whole.checks}
    assert [one.id for one in judged["starts"]] == ["hard_1", "hard_2"]
    assert len(judged["alive"]) == 3
    assert [one.id for one in select(whole, scenarios=("hard_2",)).assignment.scenarios] == [
        "hard_2"
    ]


def test_where_all_is_visible_nothing_is_left_out(tmp_path):
    whole = lesson(tmp_path, "  - {id: alive, uses: node.alive, points: 1}\n")
    assert visible_part(whole) is whole


def test_an_assignment_without_a_visible_check_is_not_for_students(tmp_path):
    whole = lesson(tmp_path, "  - {id: a, uses: node.alive, points: 1, visibility: hidden}\n")
    with pytest.raises(UsageError, match="has no visible check: everything is judged at grading"):
        visible_part(whole)


def test_a_hidden_check_cannot_be_asked_for_by_name(tmp_path):
    part = visible_part(lesson(tmp_path))
    with pytest.raises(UsageError, match=r"no check 'ends'\. There are: alive\."):
        select(part, ("ends",))


@pytest.mark.parametrize(
    ("first", "second", "fits"),
    [
        ("visible", "hidden", True),
        ("after_due_date", "after_published", True),
        ("hidden", "hidden", True),
        ("hidden", "visible", False),
        ("after_published", "after_due_date", False),
        ("hidden", "after_published", False),
    ],
)
def test_what_is_required_is_shown_no_later(first, second, fits, tmp_path):
    checks = (
        f"  - {{id: first, uses: node.starts, points: 1, visibility: {first}}}\n"
        "  - {id: second, uses: node.alive, points: 1, requires: [first], "
        f"visibility: {second}}}\n"
    )
    if fits:
        lesson(tmp_path, checks)
        return
    said = (
        rf"assignment\.yaml:18: checks\[1\]\.requires\[0\]: 'first' is '{first}', so 'second' "
        rf"cannot be '{second}': a student would lose its points for a reason that is not shown"
    )
    with pytest.raises(AssignmentError, match=said):
        lesson(tmp_path, checks)


def test_a_hidden_run_that_students_would_see_is_doubtful(tmp_path):
    def told(folder, checks):
        folder.mkdir()
        return [
            one for one in lint_warnings(lesson(folder, checks), []) if one.startswith("students")
        ]

    assert told(tmp_path / "a", CHECKS) == [
        "students see the run of the scenario 'hard', although only hidden checks name it: the "
        "visible check 'alive' names no scenarios, so it judges all"
    ]
    named = CHECKS.replace("node.alive,", "node.alive, scenarios: [run],")
    assert told(tmp_path / "b", named) == []
