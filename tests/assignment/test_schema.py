"""The JSON Schema tells an editor what the loader would say."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from grader.assignment.load import load_assignment
from grader.assignment.reference import PYTHON
from grader.assignment.schema import assignment_schema, mutants_schema
from grader.checks.catalogue import CATALOGUE
from grader.checks.check import Check
from grader.errors import AssignmentError
from grader.machine import resources
from grader.spec.source import parse_source, read_source
from tests.assignment.lessons import GOOD, HEAD
from tests.assignment.validator import valid


def fits(text: str, schema: dict[str, Any]) -> bool:
    return valid(parse_source(text, Path("assignment.yaml")).data, schema, schema)


# The little validator above knows only what the schemas of the publisher lessons use.
@pytest.mark.parametrize("name", ["simple_publisher", "timed_publisher"])
def test_the_assignments_and_their_mutants_fit(name: str) -> None:
    folder = resources.assignments() / name
    for file, schema in (
        ("assignment.yaml", assignment_schema()),
        (PYTHON.mutants, mutants_schema()),
    ):
        assert valid(read_source(folder / file).data, schema, schema)


CHECKS = [
    "{id: a, uses: node.alive, points: 1}",
    "{id: a, uses: node.alive, points: 0.5, with: {}, hint: x, visibility: hidden}",
    "{id: a, uses: topic.published, points: 1, with: {topic: /cmd_vel}}",
    "{id: a, uses: timing.period, points: 1, with: {topic: /cmd_vel, period: 300 ms}}",
    "{id: a, uses: timing.period, points: 1, with: {topic: /cmd_vel, period: 1e-1s}}",
    "{id: a, uses: node.alive, points: 1, requires: [], scenarios: [run]}",
    "{id: a, uses: node.alive, points: 1, hint: {python: x, cpp: y}}",
    "{id: a, uses: node.alive, points: 1, hint: [x, {python: x, cpp: y}]}",
    # From here on each has one mistake.
    "{id: a, uses: node.alive, points: 1, hint: {python: x}}",
    "{id: a, uses: node.alive, points: 1, hint: {python: x, cpp: y, rust: z}}",
    "{id: a, uses: node.alive}",
    "{id: a, points: 1}",
    "{id: a, uses: node.alive, python: 'checks.py:mine', points: 1}",
    "{id: a, uses: node.alife, points: 1}",
    "{id: a, uses: node.alive, points: '1'}",
    "{id: a, uses: node.alive, points: 1, point: 1}",
    "{id: a, uses: node.alive, points: 1, with: {topic: /cmd_vel}}",
    "{id: a, uses: node.alive, points: 1, visibility: hiden}",
    "{id: a, uses: node.alive, points: 1, requires: a}",
    "{id: a, uses: topic.published, points: 1}",
    "{id: a, uses: topic.published, points: 1, with: {topic: cmd_vel}}",
    "{id: a, uses: topic.published, points: 1, with: {topik: /cmd_vel}}",
    "{id: a, uses: timing.period, points: 1, with: {topic: /cmd_vel, period: 300}}",
    "{id: a, uses: timing.period, points: 1, with: {topic: /cmd_vel, period: 300 m}}",
    "{id: a, uses: timing.period, points: 1, with: {topic: /cmd_vel, period: 0}}",
    "{id: a, uses: timing.period, points: 1, with: {topic: /cmd_vel, period: '12:30'}}",
]
_GOOD = 8


@pytest.mark.parametrize(("check", "good"), [(c, i < _GOOD) for i, c in enumerate(CHECKS)])
def test_schema_and_loader_agree_on_every_check(
    check: str, good: bool, write: Callable[..., Path], catalogue: Mapping[str, Check]
) -> None:
    text = f"{HEAD}  - {check}\n"
    assert fits(text, assignment_schema(catalogue)) is good
    try:
        load_assignment(write(text), catalogue)
    except AssignmentError:
        assert not good
    else:
        assert good


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("rosgrade: 1", "rosgrade: 2"),
        ("title: A lesson", "titel: A lesson"),
        ("name: bot", "name: Bot"),
        ("timeout: 5 s", "timeout: 5"),
        ("topic: /cmd_vel", "topic: cmd_vel"),
        ("geometry_msgs/msg/Twist", "geometry_msgs/Twist"),
        ("launch: [{executable: bot_pub}]", "launch: []"),
    ],
)
def test_mistakes_outside_of_checks_show_too(
    old: str, new: str, catalogue: Mapping[str, Check]
) -> None:
    schema = assignment_schema(catalogue)
    assert fits(GOOD, schema)
    assert not fits(GOOD.replace(old, new), schema)


def test_an_own_check_may_have_any_parameters(catalogue: Mapping[str, Check]) -> None:
    schema = assignment_schema(catalogue)
    assert fits(HEAD + "  - {id: a, python: 'a.py:b', points: 1, with: {x: 1}}\n", schema)
    assert not fits(HEAD + "  - {id: a, python: 'a.b', points: 1}\n", schema)


def test_an_editor_can_explain_every_check_and_every_key() -> None:
    schema = assignment_schema()
    uses = schema["$defs"]["CheckSpec"]["properties"]["uses"]["oneOf"]
    assert {one["const"]: one["description"] for one in uses if "const" in one} == {
        check.name: check.title for check in CATALOGUE.values()
    }
    for name in ("Assignment", "Package", "Scenario", "Launch", "Until", "CheckSpec"):
        for key, found in schema["$defs"][name]["properties"].items():
            assert found.get("description"), f"{name}.{key}"


def test_mutants_need_something_to_lose() -> None:
    schema = mutants_schema()
    text = "rosgrade: 1\nmutants: [{id: a, title: A, files: {x: null}, loses: [b]}]\n"
    assert fits(text, schema)
    assert not fits(text.replace("[b]", "[]"), schema)
    assert not fits(text.replace("loses", "lose"), schema)
