"""Every mistake in a YAML file is reported with its line, in words for an author of YAML."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.assignment.model import Assignment, Until
from grader.errors import AssignmentError
from grader.spec.quantity import Duration
from grader.spec.source import Model, parse_source
from tests.assignment.lessons import GOOD, HEAD

FILE = Path("assignment.yaml")


def mistakes(text: str, model: type[Model] = Assignment) -> list[str]:
    try:
        parse_source(text, FILE).read(model)
    except AssignmentError as error:
        return str(error).splitlines()
    return []


def entry(text: str) -> list[str]:
    """Mistakes of an assignment whose only check is this."""
    return mistakes(f"{HEAD}  - {text}\n")


def test_a_good_assignment_is_read() -> None:
    assignment = parse_source(GOOD, FILE).read(Assignment)
    assert assignment.scenarios[0].timeout == 5.0
    assert assignment.scenarios[0].record[0].topic == "/cmd_vel"
    assert assignment.checks[0].points == 1.0
    # What the YAML does not say.
    assert assignment.scenarios[0].shutdown == 2.0
    assert assignment.packages[0].build_types == ("ament_python",)


def test_a_build_type_is_one_or_a_list() -> None:
    both = GOOD.replace("    exe", "    build_type: [ament_cmake, ament_python]\n    exe", 1)
    (package,) = parse_source(both, FILE).read(Assignment).packages
    assert package.build_types == ("ament_cmake", "ament_python")
    assert package.build_type == "ament_cmake"


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("{id: a, uses: b}", "checks[0]: the key 'points' is missing"),
        ("{id: a, uses: b, points: -1}", "checks[0].points: must be at least 0, not -1"),
        ("{id: a, uses: b, points: x}", "checks[0].points: expected a number, not 'x'"),
        (
            "{id: a, uses: b, points: '3'}",
            "checks[0].points: expected a number, not '3': write it without quotes",
        ),
        (
            "{id: a, uses: b, points: '0,5'}",
            "checks[0].points: expected a number, not '0,5'",
        ),
        ("{id: a, uses: b, points: .inf}", "checks[0].points: expected a finite number, not inf"),
        ("{id: a, uses: [b], points: 1}", "checks[0].uses: expected text, not a list"),
        (
            "{id: 3, uses: b, points: 1}",
            "checks[0].id: expected text, not 3: write it in quotes",
        ),
        (
            "{id: My-Check, uses: b, points: 1}",
            "checks[0].id: 'My-Check' is not an id: use lower case letters, digits and underscores",
        ),
        (
            "{id: a, uses: b, points: 1, requires: c}",
            "checks[0].requires: expected a list, not 'c'",
        ),
        (
            "{id: a, uses: b, points: 1, with_: {}}",
            "checks[0].with_: unknown key 'with_'. Did you mean 'with'?",
        ),
        (
            "{id: a, uses: b, points: 1, visibility: hiden}",
            "checks[0].visibility: expected 'visible', 'after_due_date', 'after_published' or "
            "'hidden', not 'hiden'. Did you mean 'hidden'?",
        ),
        ("x", "checks[0]: expected keys and values, not 'x'"),
        ("~", "checks[0]: expected keys and values, not nothing"),
    ],
)
def test_a_mistake_in_a_check_is_reported_in_words(written: str, said: str) -> None:
    assert entry(written) == [f"assignment.yaml:13: {said}"]


def test_a_mistyped_key_is_one_mistake_not_two() -> None:
    assert entry("{id: a, uses: b, point: 1}") == [
        "assignment.yaml:13: checks[0].point: unknown key 'point'. Did you mean 'points'?"
    ]


@pytest.mark.parametrize(
    ("hint", "mistake"),
    [
        ("{python: x}", "hint: the key 'cpp' is missing"),
        ("{pyton: x, cpp: y}", "hint.pyton: unknown key 'pyton'. Did you mean 'python'?"),
        ("[x, {python: 1, cpp: y}]", "hint[1].python: expected text, not 1: write it in quotes"),
    ],
)
def test_a_mistake_in_the_hint_of_a_language_is_one_mistake(hint: str, mistake: str) -> None:
    assert entry(f"{{id: a, uses: b, points: 1, hint: {hint}}}") == [
        f"assignment.yaml:13: checks[0].{mistake}"
    ]


def test_a_key_unlike_any_other_lists_what_is_allowed() -> None:
    (mistake,) = mistakes("messages: 3\ncolour: red", Until)
    assert mistake == (
        "assignment.yaml:2: colour: unknown key 'colour'. Allowed here: any, at_rest, elapsed, "
        "messages, quiet, stimuli, travelled."
    )


def test_all_mistakes_are_reported_at_once_in_the_order_of_their_lines() -> None:
    text = """\
rosgrade: 2
id: lesson
titel: A lesson
packages:
  - name: Bot!
    build_type: ament_pyton
scenarios:
  - id: run
    launch: []
    record:
      - topic: cmd_vel
        type: geometry_msgs/Twist
        depth: 0
        reliability: Reliable
    stimuli:
      - {call: list_paramters, every: 12:30}
    until: {quiet: 5 m}
    timeout: 5
    discovery: 0 s
    shutdown: -1 s
checks: []
"""
    assert mistakes(text) == [
        "assignment.yaml:1: rosgrade: expected 1, not 2",
        "assignment.yaml:3: titel: unknown key 'titel'. Did you mean 'title'?",
        "assignment.yaml:5: packages[0].name: 'Bot!' is not a package name: lower case letters, "
        "digits and underscores, beginning with a letter (REP-144)",
        "assignment.yaml:6: packages[0].build_type: expected 'ament_python' or 'ament_cmake', "
        "not 'ament_pyton'. Did you mean 'ament_python'?",
        "assignment.yaml:9: scenarios[0].launch: expected at least 1 entry",
        "assignment.yaml:11: scenarios[0].record[0].topic: 'cmd_vel' is relative: write the full "
        "name, '/cmd_vel'",
        "assignment.yaml:12: scenarios[0].record[0].type: 'geometry_msgs/Twist' is not an "
        "interface name (package/msg/Type). Did you mean 'geometry_msgs/msg/Twist'?",
        "assignment.yaml:13: scenarios[0].record[0].depth: must be at least 1, not 0",
        "assignment.yaml:14: scenarios[0].record[0].reliability: expected 'reliable' or "
        "'best_effort', not 'Reliable'. Did you mean 'reliable'?",
        "assignment.yaml:16: scenarios[0].stimuli[0].call: expected 'list_parameters', not "
        "'list_paramters'. Did you mean 'list_parameters'?",
        "assignment.yaml:16: scenarios[0].stimuli[0].every: '12:30' is not a time: write a number "
        "and a unit (s, ms, us, ns, min)",
        "assignment.yaml:17: scenarios[0].until.quiet: 'm' is a unit of length, but a time is "
        "needed here (s, ms, us, ns, min)",
        "assignment.yaml:18: scenarios[0].timeout: 5 has no unit: write for example '5 s'",
        "assignment.yaml:19: scenarios[0].discovery: '0 s' is too small: it must be more than 0",
        "assignment.yaml:20: scenarios[0].shutdown: '-1 s' is too small: it must be at least 0",
        "assignment.yaml:21: checks: expected at least 1 entry",
    ]


def test_a_list_is_not_called_short_because_its_entries_have_mistakes() -> None:
    assert mistakes(GOOD.replace("name: bot", "nam: bot")) == [
        "assignment.yaml:5: packages[0].nam: unknown key 'nam'. Did you mean 'name'?"
    ]


class _Scene(Model):
    wait: int | Duration = 0
    flag: bool = False


def test_the_alternatives_of_a_union_are_one_mistake() -> None:
    assert mistakes("wait: soon", _Scene) == [
        "assignment.yaml:1: wait: expected a whole number, not 'soon'; or 'soon' is not a time: "
        "write a number and a unit (s, ms, us, ns, min)"
    ]


def test_yes_is_a_word_and_no_boolean() -> None:
    assert mistakes("flag: yes", _Scene) == [
        "assignment.yaml:1: flag: expected true or false, not 'yes'"
    ]
    assert parse_source("flag: true", FILE).read(_Scene).flag is True


_value = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5) | st.sampled_from(["", "x", "5 s", "/a", "a"]),
    lambda inner: (
        st.lists(inner, max_size=2)
        | st.dictionaries(
            st.sampled_from(["id", "launch", "until", "with", "points", "x", "0"]),
            inner,
            max_size=3,
        )
    ),
    max_leaves=8,
)
_KEYS = ("rosgrade", "id", "title", "packages", "scenarios", "checks", "chekcs")


@given(st.dictionaries(st.sampled_from(_KEYS), _value))
def test_in_any_document_each_mistake_has_a_line(data: dict[str, Any]) -> None:
    text = json.dumps(data, indent=1)
    for mistake in mistakes(text):
        assert mistake.startswith("assignment.yaml:")
        assert 1 <= int(mistake.split(":")[1]) <= len(text.splitlines())
