"""A group says once what its members have in common, and means what they would say."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from grader.assignment.contract.expand import plain
from grader.assignment.load import LoadedAssignment, load_assignment
from grader.assignment.schema import assignment_schema
from grader.authoring.documentation import assignment_markdown
from grader.authoring.visible_files import visible_files
from grader.spec.document import write_yaml
from grader.spec.source import parse_source
from tests.assignment.validator import valid

HEAD = """\
rosgrade: 1
id: lesson
title: Drive
contract:
  packages:
    bot:
      depends: [rclpy, geometry_msgs]
      executables:
        drive:
          publishes:
            /cmd_vel: {type: geometry_msgs/msg/Twist}
  points: {builds: 1, topic: 1, type: 1}
"""
"""What is not in a group."""
SCENARIOS = """\
scenarios:
  - {id: alone, timeout: 3 s}
  - until: {messages: 5}
    timeout: 5 s
    scenarios:
      - {id: slow, title: Slowly}
      - {id: fast, until: {quiet: 1 s}, timeout: 8 s}
"""
CHECKS = """\
checks:
  - {id: alive, uses: node.alive, points: 0.5}
  - uses: timing.period
    with: {topic: /cmd_vel, tolerance: 5 %}
    scenarios: [slow]
    requires: [type]
    hint: Look at the timer.
    points: {period: 2, quick: 1}
    checks:
      - {id: period, with: {period: 300 ms}}
      - id: quick
        with: {period: 100 ms, tolerance: 9 %}
        scenarios: [fast]
        requires: []
      - {id: count, uses: messages.count, with: {at_least: 5, tolerance: null}, points: 3}
"""
WRITTEN_OUT = """\
scenarios:
  - {id: alone, timeout: 3 s}
  - {id: slow, title: Slowly, until: {messages: 5}, timeout: 5 s}
  - {id: fast, until: {messages: 5, quiet: 1 s}, timeout: 8 s}
checks:
  - {id: alive, uses: node.alive, points: 0.5}
  - id: period
    uses: timing.period
    with: {topic: /cmd_vel, tolerance: 5 %, period: 300 ms}
    scenarios: [slow]
    points: 2
    requires: [type]
    hint: Look at the timer.
  - id: quick
    uses: timing.period
    with: {topic: /cmd_vel, tolerance: 9 %, period: 100 ms}
    scenarios: [fast]
    points: 1
    requires: []
    hint: Look at the timer.
  - id: count
    uses: messages.count
    with: {topic: /cmd_vel, at_least: 5}
    scenarios: [slow]
    points: 3
    requires: [type]
    hint: Look at the timer.
"""
GOOD = HEAD + SCENARIOS + CHECKS

Write = Callable[[str], Path]
Mistakes = Callable[[str], list[str]]


def whole(loaded: LoadedAssignment) -> str:
    assert loaded.source is not None
    return write_yaml(plain(loaded.source))


def test_a_group_means_what_its_members_would_say(write: Write) -> None:
    grouped = load_assignment(write(GOOD))
    single = load_assignment(write(HEAD + WRITTEN_OUT))
    assert grouped.assignment == single.assignment
    assert grouped.checks == single.checks
    assert parse_source(whole(grouped), Path()).data == parse_source(whole(single), Path()).data


def test_what_is_printed_for_a_group_reads_like_other_checks(write: Write) -> None:
    printed = whole(load_assignment(write(GOOD)))
    told = "- id: quick\n  uses: timing.period\n  with:\n    topic: /cmd_vel\n    tolerance: 9 %\n"
    assert told in printed
    assert "*id" not in printed
    assert load_assignment(write(printed)).checks == load_assignment(write(GOOD)).checks


def test_a_mistake_in_what_a_group_says_is_told_once_where_it_stands(mistakes: Mistakes) -> None:
    assert mistakes(GOOD.replace("topic: /cmd_vel, tol", "topic: cmd_vel, tol")) == [
        "23: checks[1].with.topic: 'cmd_vel' is relative: write the full name, '/cmd_vel'"
    ]
    assert mistakes(GOOD.replace("timeout: 5 s", "timeout: 5")) == [
        "16: scenarios[1].timeout: 5 has no unit: write for example '5 s'"
    ]


def test_a_mistake_in_a_member_is_told_where_it_stands(mistakes: Mistakes) -> None:
    assert mistakes(GOOD.replace("period: 100 ms", "period: 100")) == [
        "31: checks[1].checks[1].with.period: 100 has no unit: write for example '100 s'"
    ]
    assert mistakes(GOOD.replace("[fast]", "[fats]")) == [
        "32: checks[1].checks[1].scenarios[0]: there is no scenario 'fats'. Did you mean 'fast'?"
    ]
    # After the group, too.
    assert mistakes(GOOD + "  - {id: more, uses: node.alife, points: 1}\n") == [
        "35: checks[2].uses: there is no check 'node.alife'. Did you mean 'node.alive'?"
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "    hint: Look",
            "    hints: Look",
            "26: checks[1].hints: unknown key 'hints' of a group. Did you mean 'hint'?",
        ),
        (
            "  - uses: timing.period\n",
            "  - id: periods\n    uses: timing.period\n",
            "22: checks[1].id: each of the checks in a group has its own 'id': leave it out here",
        ),
        (
            "      - {id: slow, title: Slowly}\n",
            "      - {id: slow, scenarios: [{id: a}]}\n",
            "18: scenarios[1].scenarios[0]: a group in a group: write it beside this one, or its "
            "members into this one",
        ),
        (
            "    scenarios:\n      - {id: slow, title: Slowly}\n",
            "    scenarios: []\n    hidden:\n",
            "17: scenarios[1].scenarios: a group has at least one of its scenarios, in a list: "
            "each begins with '- '",
        ),
        (
            "{period: 2, quick: 1}",
            "{period: 2, quik: 1}",
            "27: checks[1].points.quik: the group has no check 'quik'. Did you mean 'quick'?",
        ),
        (
            "{period: 2, quick: 1}",
            "{period: 2, quick: 1, count: 1}",
            "34: checks[1].checks[2].points: the points of 'count' stand in the group already: "
            "leave one of them out",
        ),
        (
            "{period: 2, quick: 1}",
            "2",
            "27: checks[1].points: the points of a group stand by the ids of its checks: "
            "'points: {id: 1}'",
        ),
        (
            "{period: 2, quick: 1}",
            "{period: 2}",
            "30: checks[1].checks[1]: the key 'points' is missing",
        ),
        (
            "{period: 2, quick: 1}",
            "{period: 2, quick: -1}",
            "27: checks[1].points.quick: must be at least 0, not -1",
        ),
        (
            "{id: count,",
            "{id: alive,",
            "34: checks[1].checks[2].id: 'alive' stands twice (first in line 21)",
        ),
        (
            "{id: count, uses: messages.count, with: {at_least: 5, tolerance: null}, points: 3}",
            "count",
            "34: checks[1].checks[2]: expected keys and values, not 'count'",
        ),
    ],
)
def test_a_group_that_is_not_as_it_must_be_is_refused(
    old: str, new: str, said: str, mistakes: Mistakes
) -> None:
    assert GOOD.count(old) == 1
    assert said in mistakes(GOOD.replace(old, new))


def test_students_get_no_hidden_check_of_a_group(write: Write) -> None:
    text = GOOD.replace("points: 3}", "points: 3, visibility: hidden}")
    text = text.replace("scenarios: [fast]", "scenarios: [fast]\n        visibility: hidden")
    files = visible_files(load_assignment(write(text)))
    part = load_assignment(write(files["assignment.yaml"].decode()))
    ids = [bound.spec.id for bound in part.checks]
    assert ids == ["builds", "topic", "type", "alive", "period"]
    assert (part.withheld.checks, part.withheld.points) == (2, 4.0)
    assert {"quick", "count"}.isdisjoint(files["assignment.yaml"].decode().split())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("    hint: Look", "    hints: Look"),
        ("  - uses: timing.period\n", "  - id: periods\n    uses: timing.period\n"),
        ("{id: slow, title: Slowly}", "{id: slow, titel: Slowly}"),
        ("{period: 2, quick: 1}", "{period: 2, quick: -1}"),
        ("{period: 2, quick: 1}", "2"),
        ("      - id: quick\n        with", "      - with"),
    ],
)
def test_an_editor_knows_groups(old: str, new: str) -> None:
    schema = assignment_schema()
    assert valid(parse_source(GOOD, Path()).data, schema, schema)
    assert not valid(parse_source(GOOD.replace(old, new), Path()).data, schema, schema)


def test_the_example_in_the_documentation_is_right(write: Write) -> None:
    page = assignment_markdown()["assignment-yaml.md"].partition("## Groups")[2]
    example = page.partition("```yaml\n")[2].partition("```")[0]
    place = write(HEAD.replace("{builds: 1,", "{builds: 1, alive: 1,") + example)
    (place / "worlds").mkdir()
    (place / "worlds/room.yaml").write_text("boxes: []\n")
    left, right = load_assignment(place).checks[-2:]
    assert [one.spec.points for one in (left, right)] == [2, 1]
    assert [one.spec.requires for one in (left, right)] == [("alive",), ("reaches_left",)]
    assert [one.parameters.position for one in (left, right)] == [0.1, 0.05]
