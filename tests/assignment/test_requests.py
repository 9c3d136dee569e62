"""Calls, parameters and goals in the YAML: mistakes are found before anything runs."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from grader.assignment.load import load_assignment
from grader.assignment.stimuli.kinds.request import CallService, SetParameters
from grader.assignment.stimuli.stimulus_model import Making
from grader.errors import AssignmentError

HEAD = """\
rosgrade: 1
id: lesson
title: A lesson
packages:
  - name: bot
    executables: [bot]
scenarios:
  - id: run
    launch: [{executable: bot}]
    random: {speed: [1 m/s, 2 m/s]}
    timeout: 5 s
    stimuli:
"""
TAIL = "checks: [{id: alive, uses: node.alive, points: 1}]\n"
DEFINITIONS = {
    "std_srvs/srv/SetBool": "bool data # switch\n---\nbool success\nstring message\n",
    "x/action/Fibonacci": "int32 order\n---\nint32[] sequence\n---\nint32[] sequence\n",
    "x/srv/Go": "geometry_msgs/Vector3 to\n---\n",
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
}
MAKING = Making(Path(), DEFINITIONS.__getitem__, 0, {"speed": 1.5}, [])


@pytest.fixture
def mistakes(tmp_path: Path, ros_with: Callable[..., None]) -> Callable[[str], list[str]]:
    """Load an assignment with these stimuli; each mistake as ``line: text``."""
    folder = tmp_path / "lesson"
    folder.mkdir()
    ros_with(DEFINITIONS)

    def load(stimuli: str) -> list[str]:
        file = folder / "assignment.yaml"
        body = "".join(f"      {line}\n" for line in stimuli.strip().splitlines())
        file.write_text(HEAD + body + TAIL)
        try:
            load_assignment(folder)
        except AssertionError:
            raise
        except AssignmentError as error:
            return [f"{one.line}: {one.message}" for one in error.problems]
        return []

    return load


@pytest.mark.parametrize(
    "stimulus",
    [
        "- {call: /enable, type: std_srvs/srv/SetBool, request: {data: true}, at_once: 2}",
        "- {call: /enable, type: std_srvs/srv/SetBool, requests: [{}, {data: false}], every: 1 s}",
        "- {call: list_parameters, every: 500 ms}",
        "- {call: /go, type: x/srv/Go, request: {to.x: $speed, to.y: 30 deg}}",
        "- {call: /other, type: nav2_msgs/srv/Other, request: {any: thing}}",
        "- {read_parameters: bot, after: 1 s}",
        "- {set_parameters: {speed: $speed, names: [a, b]}, node: /robot/bot}",
        "- {send_goal: /fib, type: x/action/Fibonacci, goal: {order: 5}, cancel_after: 1 s}",
        "- {send_goal: /fib, type: x/action/Fibonacci, goal: {order: 5}, preempt: true}",
    ],
)
def test_what_is_right(mistakes: Callable[[str], list[str]], stimulus: str) -> None:
    assert mistakes(stimulus) == []


@pytest.mark.parametrize(
    ("stimulus", "expected"),
    [
        (
            "- call: /enable\n  type: std_srvs/srv/SetBool\n  request: {dat: true}",
            r"15: .*has no field 'dat'. Did you mean 'data'\?",
        ),
        ("- {call: /enable, type: std_srvs/srv/SetBool, request: {data: 3}}", "expected true or"),
        ("- {call: /enable, type: std_msgs/msg/Bool}", "expected an interface in srv"),
        (
            "- {call: /e, type: std_srvs/srv/SetBool, request: {}, requests: [{}]}",
            "either 'request' or 'requests'",
        ),
        ("- {call: /e, type: std_srvs/srv/SetBool, requests: [{}], count: 2}", "'count' says how"),
        ("- {call: enable, every: 1 s}", "expected 'list_parameters'"),
        ("- {call: /enable}", "the key 'type' is missing"),
        ("- {call: /e, type: std_srvs/srv/SetBool, after: 9 s}", "is not before the timeout of 5"),
        ("- {set_parameters: {}, node: bot}", "at least 1"),
        ("- {set_parameters: {a: []}, node: bot}", "an empty list has no type"),
        ("- {set_parameters: {a: [1, x]}, node: bot}", "a list of one kind"),
        ("- {set_parameters: {a: {b: 1}}, node: bot}", "expected a truth, a number, a text"),
        ("- {set_parameters: {a: $sped}, node: bot}", "Did you mean 'speed'"),
        ("- {set_parameters: {a: 1}, node: b-t}", "is not a node name"),
        ("- {set_parameters: {a: 1}}", "the key 'node' is missing"),
        (
            "- {send_goal: /fib, type: x/action/Fibonacci, goal: {ordre: 5}}",
            "Did you mean 'order'",
        ),
        ("- {send_goal: /fib, type: x/srv/Go}", "expected an interface in action"),
        ("- {send_gaol: /fib, type: x/action/Fibonacci}", "Did you mean 'send_goal'"),
    ],
)
def test_what_is_wrong(mistakes: Callable[[str], list[str]], stimulus: str, expected: str) -> None:
    found = mistakes(stimulus)
    assert any(re.search(expected, one) for one in found), found


def test_requests_have_values_in_si_units_and_drawn_ones() -> None:
    call = CallService.model_validate(
        {
            "call": "/go",
            "type": "x/srv/Go",
            "request": {"to.x": "$speed", "to.y": "180 deg"},
            "count": 2,
        }
    )
    first, second = call.order(MAKING)["requests"]
    assert first == second == {"to": {"x": 1.5, "y": pytest.approx(3.14159265)}}


def test_the_type_of_a_parameter_is_that_of_the_yaml() -> None:
    given = {"a": 1, "b": 1.0, "c": "2 m", "d": True, "e": "text", "f": [1, 2.5], "g": "$speed"}
    item = SetParameters.model_validate({"set_parameters": given, "node": "bot"})
    found = item.order(MAKING)["values"]
    assert found == {"a": 1, "b": 1.0, "c": 2.0, "d": True, "e": "text", "f": [1, 2.5], "g": 1.5}
    assert [type(found[name]) for name in "abcd"] == [int, float, float, bool]
