"""The grade in a terminal."""

import io
import unicodedata
from dataclasses import replace

import pytest
from rich.console import Console

from grader.checks.finding import Evidence, Finding
from grader.grade import grade
from grader.recording.event import Breach
from grader.report.text.terminal import print_grade
from tests.grade.sample import Told, make_loaded, make_submission
from tests.report.sample import (
    Sample,
    at,
    everywhere,
    full_points,
    lost_points,
    make_facts,
    make_run,
    not_built,
    not_graded,
)

AT_80 = """\
Publish a Twist every 300 ms   ada_lovelace

✓ passed   The package builds             1 / 1
✗ failed   It publishes every 300 ms   1.02 / 3
– skipped  The period is steady           0 / 2
✓ passed   The node ends after SIGINT     1 / 1

✗ failed  It publishes every 300 ms
  expected  a period of 300 ms within 5 % (285 to 315 ms)
  observed  a median of 322.4 ms; 2 of 3 periods are longer than 315 ms, the
            longest is 612 ms
  try next  The period grows with the work in the callback. A timer keeps the
            period.
  also      Let a timer do the waiting: `create_timer(0.3, callback)`.
  where     src/bot_publisher/bot_publisher/node.py:18: time.sleep(0.3)
  printed   loop took 0.31 s
  waiting   2 points wait for this

Fix this first: It publishes every 300 ms
(src/bot_publisher/bot_publisher/node.py:18). 1 other check waits for it.
Score: 3.02 of 7 points
"""
AT_120 = """\
Publish a Twist every 300 ms   ada_lovelace

✓ passed   The package builds             1 / 1  built in 1.3 s
✗ failed   It publishes every 300 ms   1.02 / 3  a median of 322.4 ms; 2 of 3 periods are longer than 315 ms, the longe…
– skipped  The period is steady           0 / 2  waits for It publishes every 300 ms
✓ passed   The node ends after SIGINT     1 / 1  /bot_publisher

✗ failed  It publishes every 300 ms
  expected  a period of 300 ms within 5 % (285 to 315 ms)
  observed  a median of 322.4 ms; 2 of 3 periods are longer than 315 ms, the longest is 612 ms
  try next  The period grows with the work in the callback. A timer keeps the period.
  also      Let a timer do the waiting: `create_timer(0.3, callback)`.
  where     src/bot_publisher/bot_publisher/node.py:18: time.sleep(0.3)
  printed   loop took 0.31 s
  waiting   2 points wait for this

Fix this first: It publishes every 300 ms (src/bot_publisher/bot_publisher/node.py:18). 1 other check waits for it.
Score: 3.02 of 7 points
"""  # noqa: E501


def printed(sample, width=80, **options):
    stream = io.StringIO()
    console = Console(file=stream, width=width, highlight=False, emoji=False, **options)
    print_grade(console, sample.grade, sample.recordings)
    return stream.getvalue()


@pytest.mark.parametrize(("width", "text"), [(80, AT_80), (120, AT_120)])
def test_lost_points_as_a_student_reads_them(width, text):
    lines = [line.rstrip() for line in printed(lost_points(), width).splitlines()]
    assert lines == text.splitlines()


@pytest.mark.parametrize("width", [40, 80, 120])
@pytest.mark.parametrize("make", [lost_points, not_built, not_graded, full_points])
def test_no_line_is_wider_than_the_terminal(make, width):
    assert max(len(line) for line in printed(make(), width).splitlines()) <= width


def test_a_wide_terminal_also_tells_what_was_observed():
    text = printed(lost_points(), 120)
    assert "1 / 1  built in 1.3 s" in text
    assert "0 / 2  waits for It publishes every 300 ms" in text


def test_full_points():
    text = printed(full_points())
    assert text.endswith("\nScore: 3 of 3 points\n")
    assert "Fix this first" not in text


def test_limits_of_the_sandbox_that_were_reached_are_told():
    sample = full_points()
    reached = (
        Breach(at(0.8), "memory", "1056 MiB of memory", "1024 MiB"),
        Breach(at(1.2), "disk", "all space in /tmp and home", "256 MiB"),
    )
    text = printed(replace(sample, recordings={"listen": make_run(breaches=reached)}), 80)
    assert text.endswith("""
Limits of the sandbox that were reached
  reached   the processes of the submission took 1056 MiB of memory, 1024 MiB
            are allowed; they were ended for it (scenario listen, 0.8 s after
            launch)
  reached   the processes of the submission took all space in /tmp and home, 256
            MiB are allowed; anything more is refused (scenario listen, 1.2 s
            after launch)

Score: 3 of 3 points
""")
    assert "Limits" not in printed(sample)


def test_what_is_worth_knowing_of_a_run_is_told():
    sample = full_points()
    run = make_run(environment={"other_domains": "7"})
    text = printed(replace(sample, recordings={"listen": run}), 80)
    assert text.endswith("""
Worth knowing
  remark    the submission joined another ROS domain: 7 (scenario listen)

Score: 3 of 3 points
""")
    assert "Worth knowing" not in printed(sample)


def test_what_is_the_same_in_several_scenarios_is_said_once():
    sample = lost_points()
    period = sample.grade.result("period")
    [item] = period.findings
    other = replace(item.finding, observed="a median of 310 ms")
    findings = [
        replace(item, scenario="near"),
        replace(item, scenario="far", finding=other),
        replace(item, scenario="late"),
    ]
    results = tuple(
        replace(result, findings=tuple(findings)) if result is period else result
        for result in sample.grade.results
    )
    text = printed(replace(sample, grade=replace(sample.grade, results=results)))
    assert text.count("  expected  ") == text.count("  try next  ") == text.count("  where  ") == 1
    assert text.count("  observed  ") == 2
    assert "  scenario  near and late\n" in text and "  scenario  far\n" in text


def test_a_remark_on_several_runs_is_told_once():
    run = make_run(environment={"other_domains": "7"})
    runs = {name: replace(run, scenario=name) for name in ("near", "far")}
    text = printed(replace(full_points(), recordings=runs), 80)
    assert "ROS domain: 7 (scenarios near and far)\n" in text


def test_marks_below_a_line_of_a_traceback_are_left_out():
    lines = (
        "    sys.exit(load())",
        "             ^^^^^^",
        "    x = a / b",
        "        ~~^~~",
        "Error",
    )
    failed = Finding.failed("x", "y", "z", Evidence(log=lines))
    loaded = make_loaded([Told("starts", failed)])
    result = grade(loaded, make_submission(), {"listen": make_run()})
    text = printed(Sample(result, {}, make_facts()))
    assert "printed       sys.exit(load())\n                x = a / b\n            Error\n" in text


def test_what_was_not_graded_has_no_score():
    text = printed(not_graded())
    assert "Score" not in text
    assert "! error" in text and "? / 1" in text
    assert "Not graded. Something of the grader or of the machine failed" in text


def test_a_file_or_a_pipe_gets_no_escape_sequences():
    assert "\x1b" not in printed(lost_points())


def test_a_terminal_gets_colours_unless_they_are_unwanted(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    options = {"force_terminal": True, "color_system": "standard"}
    assert "\x1b[32m" in printed(lost_points(), **options)
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b[32m" not in printed(lost_points(), **options)


@pytest.mark.parametrize(
    "attack",
    ["[bold red]passed[/]", "[link=https://example.org]x[/link]", ":smile:", "[/]", "\\[b]"],
)
def test_markup_is_printed_as_it_is(attack):
    assert attack in printed(everywhere(attack), 200)


@pytest.mark.parametrize("attack", ["\x1b[2J", "\x1b]0;title\x07", "\x9b31m", "\r\x08", "\u202e"])
@pytest.mark.parametrize("width", [80, 120])
def test_nothing_of_a_students_reaches_the_terminal_as_a_command(attack, width):
    text = printed(everywhere(f"before{attack}after"), width)
    commands = {char for char in text if unicodedata.category(char) in ("Cc", "Cf")}
    assert commands == {"\n"}


def test_a_terminal_without_unicode_gets_other_symbols():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    print_grade(Console(file=stream, width=80), everywhere("Grüße").grade)
    stream.flush()
    text = stream.buffer.getvalue().decode("ascii")
    assert "x failed" in text and "+ passed" in text
    assert "Gr\\xfc\\xdfe" in text
