"""What changed between two grades, and how a terminal tells it."""

import io

import pytest
from rich.console import Console

from grader.checks.finding import Finding
from grader.grade import grade
from grader.report.model.changes import changes
from grader.report.text.terminal import print_changes
from tests.grade.sample import FAIL, PASS, Told, make_loaded, make_recording, make_submission

OTHER = Finding.failed("a node /bot_publisher", "a node /bot", "Look at super().__init__().")


def graded(**says):
    known = {
        "builds": Told("builds", PASS, points=1),
        "node": Told("node", PASS, points=2, title="The node is there"),
        "period": Told("period", PASS, points=3, requires=("node",), title="It is on time"),
    }
    checks = [
        Told(
            told.id,
            says.get(name, told.says),
            requires=told.requires,
            points=told.points,
            title=told.title,
        )
        for name, told in known.items()
    ]
    return grade(make_loaded(checks), make_submission(), {"listen": make_recording()})


def printed(before, after, width):
    stream = io.StringIO()
    print_changes(Console(file=stream, width=width, highlight=False, emoji=False), before, after)
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines())


def test_a_check_that_came_out_the_same_is_no_change():
    assert changes(graded(), graded()) == ()
    assert changes(graded(node=FAIL), graded(node=OTHER)) == ()


def test_status_and_points_are_changes_in_the_author_s_order():
    found = changes(graded(node=FAIL), graded())
    assert [change.after.id for change in found] == ["node", "period"]
    half = Finding.failed("on time", "late", "Use a timer.", credit=0.5)
    late = Finding.failed("on time", "very late", "Use a timer.", credit=0.25)
    assert [c.after.id for c in changes(graded(period=half), graded(period=late))] == ["period"]


def test_a_check_that_was_not_judged_before_is_new():
    before = grade(
        make_loaded([Told("builds", points=1)]), make_submission(), {"listen": make_recording()}
    )
    assert [change.before for change in changes(before, graded())] == [None, None]


LOST = """\
✗ failed   was passed  The node is there  0 / 2
– skipped  was passed  It is on time      0 / 3

✗ failed  The node is there
  expected  a node /bot_publisher
  observed  no node at all
  try next  Call rclpy.spin(node).
  waiting   3 points wait for this

Fix this first: The node is there. 1 other check waits for it.
Score: 1 of 6 points, before 6"""

WON = """\
✓ passed  was failed   The node is there  2 / 2
✓ passed  was skipped  It is on time      3 / 3

Score: 6 of 6 points, before 1"""

SAME = """\
No check changed.

✗ failed  The node is there
  expected  a node /bot_publisher
  observed  a node /bot
  try next  Look at super().__init__().
  waiting   3 points wait for this

Fix this first: The node is there. 1 other check waits for it.
Score: 1 of 6 points"""


@pytest.mark.parametrize("width", [80, 120])
@pytest.mark.parametrize(
    ("before", "after", "text"),
    [
        ({}, {"node": FAIL}, LOST),
        ({"node": FAIL}, {}, WON),
        ({"node": FAIL}, {"node": OTHER}, SAME),
    ],
)
def test_what_a_student_reads_after_a_save(before, after, text, width):
    assert printed(graded(**before), graded(**after), width) == text


def test_nothing_is_wider_than_a_narrow_terminal():
    text = printed(graded(), graded(node=FAIL), 40)
    assert max(len(line) for line in text.splitlines()) <= 40
