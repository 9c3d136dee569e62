"""Variables of an assignment: what is wrong in them is told with its line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from grader.assignment.interfaces import write_interfaces
from grader.assignment.variable import Variable, fill, form
from tests.assignment.lessons import GOOD

Mistakes = Callable[..., list[str]]


def with_variables(text: str) -> str:
    return GOOD.replace("packages:\n", f"variables:\n  {text}\npackages:\n", 1)


@pytest.mark.parametrize(
    ("variable", "told"),
    [
        ("n: {example: 7}", "5: variables.n: give a 'match', such as group{n}_bot or any, or a"),
        ("n: {match: 'group{n}_bot'}", "5: variables.n: the key 'example' is missing"),
        ("n: {match: group_bot, example: 7}", "5: variables.n.match: 'group_bot' must have {n}"),
        ("n: {match: 'g{n}{m}', example: 7}", "5: variables.n.match: 'g{n}{m}' must have {n} in"),
        ("n: {match: any, of: '{m}', example: 7}", "5: variables.n.of: '{m}' may have only"),
        ("n: {match: 'g{n}', example: a b}", "5: variables.n: the 'example' must be of letters"),
        ("n: {match: 'g{n}', in: package, example: 7}", "Did you mean 'packages'?"),
        (
            "n: {match: any, in: nodes, where: {node: a}, example: b}",
            "5: variables.n: 'node' says nothing of 'match: any' in nodes",
        ),
        (
            "n: {match: any, in: nodes, where: {publishes: '{m}'}, example: b}",
            "5: variables.n.where: {'publishes': '{m}'} may have only variables in it that stand",
        ),
        (
            "n: {match: 'g{n}', where: {publishes: /a}, example: 7}",
            "5: variables.n: 'publishes' says nothing of 'match: g{n}' in packages",
        ),
        (
            "n: {match: any, in: nodes, where: {publish: /a}, example: b}",
            "5: variables.n.where.publish: unknown key 'publish'. Did you mean 'publishes'?",
        ),
    ],
)
def test_a_mistake_in_a_variable_is_told(mistakes: Mistakes, variable: str, told: str) -> None:
    found = mistakes(with_variables(variable))
    assert len(found) == 1 and told in found[0]


def test_the_example_must_make_names_that_an_author_may_use(mistakes: Mistakes) -> None:
    text = with_variables("n: {match: '{n}_bot', example: 7}").replace("bot\n", "'{n}_bot'\n", 1)
    assert any("'7_bot' is not a package name" in line for line in mistakes(text))


def test_a_variable_that_is_not_declared_stays_and_is_no_name(mistakes: Mistakes) -> None:
    found = mistakes(GOOD.replace("  - name: bot\n", "  - name: bot{n}\n"))
    assert any("'bot{n}' is not a package name" in line for line in found)


def test_values_stand_in_keys_and_texts_and_nowhere_else() -> None:
    before = {"/g{n}/a": ["{n}", "{n}.", "{m}", "${n}", 1], "b": {"c": None}}
    after = {"/g07/a": ["07", "07.", "{m}", "${n}", 1], "b": {"c": None}}
    assert fill(before, {"n": "07"}) == after
    assert fill("{n}", {"n": "12"}) == 12


@pytest.mark.parametrize(
    ("name", "value"), [("group7_gp2", "7"), ("group07_gp2", "07"), ("group_gp2", None)]
)
def test_a_number_as_example_lets_only_digits_be_chosen(name: str, value: str | None) -> None:
    variables = {"n": Variable(match="group{n}_gp2", example=7)}
    found = form("n", variables, {}).fullmatch(name)
    assert (found and found["value"]) == value


def test_a_form_may_have_other_variables_known_or_not() -> None:
    one = Variable(match="{team}_{robot}.x", example="red")
    variables = {"team": one, "robot": one}
    found = form("team", variables, {}).fullmatch("red_arm.x")
    assert found is not None and found["value"] == "red"
    assert form("robot", variables, {"team": "blue"}).fullmatch("red_arm.x") is None


def test_a_text_in_a_form_may_be_the_name_of_the_variable() -> None:
    one = Variable(match="grp{k}n{n}", example="7")
    found = form("n", {"k": one, "n": one}, {}).fullmatch("grp_An7")
    assert found is not None and found["value"] == "7"


def test_interfaces_are_written_with_the_names_of_the_submission(tmp_path: Path) -> None:
    package = tmp_path / "interfaces" / "g{n}_msgs" / "msg"
    package.mkdir(parents=True)
    (package / "State.msg").write_text("g{n}_msgs/Other other\n", encoding="utf-8")
    write_interfaces(tmp_path, {"n": "7"}, tmp_path / "made")
    made = tmp_path / "made" / "g7_msgs" / "msg" / "State.msg"
    assert made.read_text(encoding="utf-8") == "g7_msgs/Other other\n"
