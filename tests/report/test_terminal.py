"""The grade in a terminal, and what changed since the grade before."""

import io
import unicodedata
from dataclasses import replace

import pytest
from rich.console import Console

from grader.findings.finding import Evidence, Finding
from grader.report.text.terminal import print_changes, print_grade
from tests.grade.sample import FAIL, PASS, Told
from tests.report.sample import (
    everywhere,
    full_points,
    judged,
    lost_points,
    make_run,
    not_built,
    not_graded,
    reached_limits,
)

AT_80 = """\
Publish a Twist every 300 ms   ada_lovelace

✓ passed   The package builds             1 / 1
✗ failed   It publishes every 300 ms   1.02 / 3
– skipped  The period is steady           0 / 2
✓ passed   The node ends after SIGINT     1 / 1

✗ failed  Not yet: It publishes every 300 ms
  expected  a period of 300 ms within 5 % (285 to 315 ms)
  observed  a median of 322.4 ms; 2 of 3 periods are longer than 315 ms, the
            longest is 612 ms
  try next  The period grows with the work in the callback. A timer keeps the
            period.
  also      Let a timer do the waiting: `create_timer(0.3, callback)`.
  where     src/bot_publisher/bot_publisher/node.py:18: time.sleep(0.3)
  printed   loop took 0.31 s
  waiting   2 points wait for this

Fix this first: “It publishes every 300 ms”
(src/bot_publisher/bot_publisher/node.py:18). 1 other check waits for it.
Score: 3.02 of 7 points
"""
TABLE_AT_120 = """\
✓ passed   The package builds             1 / 1  built in 1.3 s
✗ failed   It publishes every 300 ms   1.02 / 3  a median of 322.4 ms; 2 of 3 periods are longer than 315 ms, the longe…
– skipped  The period is steady           0 / 2  waits for It publishes every 300 ms
✓ passed   The node ends after SIGINT     1 / 1  /bot_publisher
"""  # noqa: E501


def test_lost_points_as_a_student_reads_them():
    assert lost_points().printed() == AT_80


def test_a_wide_terminal_also_tells_what_was_observed():
    text = lost_points().printed(120)
    assert TABLE_AT_120 in text
    assert (
        "  observed  a median of 322.4 ms; 2 of 3 periods are longer than 315 ms, the longest"
        in text
    )


@pytest.mark.parametrize("width", [40, 80, 120])
@pytest.mark.parametrize("make", [lost_points, not_built, not_graded, full_points, reached_limits])
def test_no_line_is_wider_than_the_terminal(make, width):
    assert max(map(len, make().printed(width).splitlines())) <= width


def test_limits_that_were_reached_and_what_is_worth_knowing_stand_before_the_score():
    limits = "".join(reached_limits().printed().partition("Limits of")[1:])
    assert limits.startswith(
        """Limits of the sandbox that were reached
  note      scenario listen: its processes took 1056 MiB of memory, 1024 MiB are
            allowed

Worth knowing
  note      scenario listen: a node of the submission is called"""
    )
    assert limits.endswith("  note      10 more: see the report\n\nScore: 3 of 3 points\n")


def test_a_remark_on_several_runs_is_shown_once():
    run = make_run(environment={"other_domains": "7"})
    runs = {"listen": run, "far": replace(run, scenario="far")}
    sample = judged([Told("node")], ("listen", "far"))
    text = replace(sample, recordings=runs).printed()
    assert (
        "  note      scenarios listen and far: the submission joined another ROS domain:\n" in text
    )


def test_what_is_the_same_in_several_scenarios_is_shown_once():
    evidence = Evidence(log=("killed",))
    same = Finding.failed("a period of 300 ms", "a median of 322 ms", "Use a timer.", evidence)
    says = {"near": same, "far": replace(same, observed="a median of 310 ms"), "late": same}
    text = judged([Told("period", says)], tuple(says)).printed()
    for name in ("expected", "try next", "printed"):
        assert text.count(f"  {name:8}  ") == 1
    assert text.count("  observed  ") == 2
    assert "  scenario  near and late\n" in text and "  scenario  far\n" in text


def test_marks_below_a_line_of_a_traceback_are_left_out():
    lines = ("    sys.exit(load())", "             ^^^^^^", "    x = a / b", "        ~~^~~", "End")
    text = judged([Told("starts", Finding.failed("x", "y", "z", Evidence(log=lines)))]).printed()
    assert "printed       sys.exit(load())\n                x = a / b\n            End\n" in text


def test_what_was_not_graded_has_no_score():
    text = not_graded().printed()
    assert "Score" not in text
    assert "! error" in text and "? / 1" in text
    assert "Not graded. Something failed in the grader or the machine" in text


def test_a_terminal_gets_colours_unless_they_are_unwanted(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    options = {"force_terminal": True, "color_system": "standard"}
    assert "\x1b[32m" in lost_points().printed(**options)
    assert "\x1b" not in lost_points().printed()
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b[32m" not in lost_points().printed(**options)


@pytest.mark.parametrize(
    "attack",
    ["[bold red]passed[/]", "[link=https://example.org]x[/link]", ":smile:", "[/]", "\\[b]"],
)
def test_markup_is_printed_as_it_is(attack):
    assert attack in everywhere(attack).printed(200)


@pytest.mark.parametrize("attack", ["\x1b[2J", "\x1b]0;title\x07", "\x9b31m", "\r\x08", "\u202e"])
@pytest.mark.parametrize("width", [80, 120])
def test_nothing_of_a_students_reaches_the_terminal_as_a_command(attack, width):
    text = everywhere(f"before{attack}after").printed(width)
    commands = {char for char in text if unicodedata.category(char) in ("Cc", "Cf")}
    assert commands == {"\n"}


def test_a_terminal_without_unicode_gets_other_symbols():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    print_grade(Console(file=stream, width=80), "Grüße", everywhere("Grüße").result)
    stream.flush()
    text = stream.buffer.getvalue().decode("ascii")
    assert "x failed" in text and "+ passed" in text
    assert "Gr\\xfc\\xdfe" in text


OTHER = Finding.failed("a node /bot_publisher", "a node /bot", "Look at super().__init__().")
LATE = Finding.failed("on time", "late", "Use a timer.", credit=0.5)
VERY_LATE = Finding.failed("on time", "very late", "Use a timer.", credit=0.25)
LOST = """\
Since your last save: “The node is there”: passed → failed, −2; 1 check now waits, −3

✗ failed  Not yet: The node is there
  expected  a node /bot_publisher
  observed  no node at all
  try next  Call rclpy.spin(node).
  waiting   3 points wait for this

Fix this first: “The node is there”. 1 other check waits for it.
Score: 1 of 6 points, before 6
"""
WON = """\
Since your last save: “The node is there”: failed → passed, +2; 1 check no longer waits, +3

Score: 6 of 6 points, before 1
"""
SAME = """\
Since your last save: no check changed

✗ failed  Not yet: The node is there
  expected  a node /bot_publisher
  observed  a node /bot
  try next  Look at super().__init__().
  waiting   3 points wait for this

Fix this first: “The node is there”. 1 other check waits for it.
Score: 1 of 6 points
"""


def graded(node=PASS, period=PASS, only=3):
    checks = [
        Told("builds", points=1),
        Told("node", node, points=2, title="The node is there"),
        Told("period", period, points=3, requires=("node",), title="It is on time"),
    ]
    return judged(checks[:only]).result


def changes(before, after, width=80, scores=()):
    stream = io.StringIO()
    print_changes(Console(file=stream, width=width, highlight=False), before, after, scores)
    return "\n".join(line.rstrip() for line in stream.getvalue().split("\n"))


@pytest.mark.parametrize("width", [80, 120])
@pytest.mark.parametrize(
    ("before", "after", "text"),
    [
        (graded(), graded(FAIL), LOST),
        (graded(FAIL), graded(), WON),
        (graded(FAIL), graded(OTHER), SAME),
    ],
)
def test_what_a_student_reads_after_a_save(before, after, text, width):
    # The first line may be wrapped.
    first, blank, rest = changes(before, after, width).partition("\n\n")
    assert " ".join(first.split()) + blank + rest == text


def test_points_alone_are_a_change():
    text = changes(graded(period=LATE), graded(period=VERY_LATE))
    assert text.startswith("Since your last save: “It is on time”: failed, −0.75\n")
    assert text.endswith("Score: 3.75 of 6 points, before 4.5\n")


def test_the_scores_of_the_evening_stand_behind_what_changed():
    text = changes(graded(FAIL), graded(FAIL), scores=(0, 3, 6))
    assert text.startswith("Since your last save: no check changed   ▁▅█\n")
