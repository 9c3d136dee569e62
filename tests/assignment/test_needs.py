"""What checks of services, actions and parameters need, and what looks like a mistake."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from grader.assignment.lint_warnings import lint_warnings
from grader.assignment.load import load_assignment
from grader.assignment.mutant import Mutant

HEAD = """\
rosgrade: 1
id: lesson
title: A lesson
points: 3
packages:
  - name: bot
    executables: [bot]
scenarios:
  - id: run
    launch: [{executable: bot}]
    record: [{topic: /speed, type: std_msgs/msg/Float64}]
    timeout: 9 s
    stimuli:
      - {call: /enable, type: std_srvs/srv/SetBool}
      - {call: /bot/get_state, type: lifecycle_msgs/srv/GetState}
      - {set_parameters: {speed: 0.5}, node: bot}
      - {send_goal: /fib, type: x/action/Fib}
checks:
"""
ALIVE = "  - {id: alive, uses: node.alive, points: 1}\n"


Found = Callable[..., list[str]]


@pytest.fixture
def found(mistakes: Callable[[str], list[str]], ros_with: Callable[..., None]) -> Found:
    """Load an assignment with a check worth 2 points."""
    ros_with(None)

    def load(uses: str, parameters: str, replace: tuple[str, str] = ("", "")) -> list[str]:
        check = f"  - {{id: it, uses: {uses}, with: {{{parameters}}}, points: 2}}\n"
        return mistakes((HEAD + ALIVE + check).replace(*replace))

    return load


@pytest.mark.parametrize(
    ("uses", "parameters"),
    [
        ("service.responds", "service: /enable"),
        ("lifecycle.state", "node: bot, states: [active]"),
        ("parameter.declared", "node: bot, name: anything"),
        (
            "parameter.takes_effect",
            "node: bot, name: speed, value: 0.5, topic: /speed, fields: {data: 0.5}",
        ),
        ("action.result", "action: /fib, within: 1 s"),
        ("source.ruff", "package: bot, rules: [F, E501, PL]"),
    ],
)
def test_what_fits_is_accepted(found: Found, uses: str, parameters: str) -> None:
    assert found(uses, parameters) == []


@pytest.mark.parametrize(
    ("uses", "parameters", "expected"),
    [
        ("service.responds", "service: /enabel", r"calls '/enabel'\. Did you mean '/enable'\?"),
        (
            "service.concurrent",
            "service: /enable, takes: 1 s",
            "with 'at_once': add 'at_once: 2'",
        ),
        ("action.result", "action: /fib, within: 11 s", "waits only 10 s for an answer"),
        ("lifecycle.state", "node: other, states: [active]", "calls '/other/get_state'"),
        ("parameter.declared", "node: bto, name: x", r"Did you mean '/bot'\?"),
        ("parameter.set", "node: bot, name: speed, value: 0.6", "to 0.5, never to 0.6"),
        (
            "messages.follows",
            "topic: /speed, source: /sped, fields: {data: data}, tolerance: 0.1",
            r"does not record '/sped'\. Did you mean '/speed'\?",
        ),
        ("action.cancels", "action: /fib", "to '/fib' with 'cancel_after': add '"),
        ("source.ruff", "package: bot, rules: [F, F999999]", "ruff has no rule 'F999999'"),
    ],
)
def test_what_does_not_fit(found: Found, uses: str, parameters: str, expected: str) -> None:
    told = found(uses, parameters)
    assert any(re.search(expected, one) for one in told), told
    assert all(one.startswith("20: ") for one in told), told


def test_points_that_do_not_add_up(found: Found) -> None:
    told = found("node.starts", "", ("points: 3", "points: 4"))
    assert told == ["4: points: the points of all checks add up to 3, not to 4"]


@pytest.mark.parametrize(
    ("launch", "expected"),
    [
        ("{executable: bot, file: bot.launch.py}", "either an 'executable' or a launch 'file'"),
        ("{file: bot.launch.py, remap: {a: b}}", "leave out remap"),
        ("{file: launch/bot.launch.py}", "should match pattern"),
        ('{file: bot.launch.py, arguments: ["speed:=0.5"]}', None),
    ],
)
def test_a_launch_is_an_executable_or_a_file(
    found: Found, launch: str, expected: str | None
) -> None:
    told = found("node.starts", "", ("{executable: bot}", launch))
    assert any(expected in one for one in told) if expected else told == [], told


def test_misspelt_topics_and_checks_without_a_mutant_are_warned_of(
    found: Found, tmp_path: Path
) -> None:
    assert found("topic.published", "topic: /sped") == []
    loaded = load_assignment(tmp_path / "lesson")
    mutant = Mutant.model_validate({"id": "dies", "title": "Dies", "loses": ["alive"]})
    assert list(lint_warnings(loaded, [mutant])) == [
        "the check 'it' is about '/sped', which the scenario 'run' neither records nor sends. "
        "Did you mean '/speed'?",
        "no mutant loses the check 'it': nothing shows that it can fail",
    ]
    assert any("there is no mutants.yaml" in one for one in lint_warnings(loaded, None))


@pytest.mark.parametrize(
    ("uses", "parameters", "warned"),
    [
        ("node.exists", "name: bot, publishes: /sped", ["/sped"]),
        ("node.exists", "name: bot, publishes: /speed", []),
        ("topic.untouched", "topics: [/sped, /tf, /speed]", ["/sped"]),
        ("topic.untouched", "", []),
    ],
)
def test_a_topic_that_a_check_names_on_the_way_may_be_misspelt_too(
    found: Found,
    tmp_path: Path,
    uses: str,
    parameters: str,
    warned: list[str],
) -> None:
    assert found(uses, parameters) == []
    mutant = Mutant.model_validate({"id": "dies", "title": "Dies", "loses": ["alive", "it"]})
    told = list(lint_warnings(load_assignment(tmp_path / "lesson"), [mutant]))
    assert [one.partition(" is about ")[2].partition(",")[0] for one in told] == [
        repr(topic) for topic in warned
    ]


CHATTER = ("/speed, type: std_msgs/msg/Float64", "/chatter, type: std_msgs/msg/String")


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ("topic: /chatter, fields: [number(data)]", "nothing sends '/chatter' in the scenario"),
        ("topic: /enable, fields: [data], own: true", "records no '/enable' of the student"),
        ("topic: /chatter, fields: [number(data)], own: true", ""),
    ],
)
def test_a_log_of_what_the_student_publishes_is_asked_for_as_that(
    found: Found, parameters: str, words: str
) -> None:
    problems = found("log.follows", parameters, CHATTER)
    assert [words in one for one in problems] == ([True] if words else [])


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ("names: [speed]", "launches nothing with 'parameters'"),
        ("names: [sped]", "gives no parameter 'sped'. Did you mean 'speed'?"),
        ("names: [speed]", ""),
    ],
)
def test_parameters_are_asked_for_only_where_a_launch_gives_them(
    found: Found, parameters: str, words: str
) -> None:
    given = ("{executable: bot}", "{executable: bot, parameters: {speed: 1.0}}")
    problems = found("parameter.given", parameters, ("", "") if "nothing" in words else given)
    assert [words in one for one in problems] == ([True] if words else [])
