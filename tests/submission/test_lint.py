"""What ruff finds: all of it, without the student's configuration, and bounded."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.submission.read.lint import EXCLUDED, find_ruff, known_rules, lint, newer_syntax
from grader.submission.read.outline import outline


def codes(root: Path, *files: str) -> set[str]:
    found = lint(root, files)
    assert found.problem is None
    return {item.code for item in found.findings}


def test_places_are_relative_to_the_submission(tmp_path: Path) -> None:
    (tmp_path / "a b").mkdir()
    (tmp_path / "a b" / "node.py").write_text("import os\n\n\ndef f():\n    return undefined\n")
    found = lint(tmp_path, ["a b/node.py"])
    places = {(item.code, item.file, item.line) for item in found.findings}
    assert ("F401", "a b/node.py", 1) in places
    assert ("F821", "a b/node.py", 5) in places


def test_neither_configuration_nor_noqa_has_a_say(tmp_path: Path) -> None:
    (tmp_path / "ruff.toml").write_text('lint.ignore = ["ALL"]\nexclude = ["*"]\n')
    (tmp_path / "node.py").write_text("# ruff: noqa\nimport os  # noqa\n")
    assert "F401" in codes(tmp_path, "node.py")


def test_many_places_of_one_rule_do_not_hide_another(tmp_path: Path) -> None:
    (tmp_path / "node.py").write_text("import os\n" * 5000 + "print(nothing)\n")
    found = lint(tmp_path, ["node.py"])
    assert len(found.findings) < 500
    assert "F821" in {item.code for item in found.findings}


def test_without_ruff_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grader.submission.read.lint.find_ruff", lambda: None)
    assert lint(tmp_path, ["a.py"]).problem == "ruff is not installed: `pip install ruff`"


def test_a_ruff_that_fails_is_reported(tmp_path: Path) -> None:
    ruff = tmp_path / "ruff"
    ruff.write_text("#!/bin/sh\nexit 101\n")
    ruff.chmod(0o755)
    assert lint(tmp_path, ["a.py"], ruff).problem == "ruff failed"


def test_the_rules_are_known() -> None:
    ruff = find_ruff()
    assert ruff is not None
    rules = known_rules(ruff)
    assert {"F401", "D211", "E501"} <= rules
    assert not rules & EXCLUDED.keys()


@settings(max_examples=150, deadline=None)
@given(st.text(max_size=40).map(lambda text: f"class A(B[{text!r}], c.d, e(f)): x = print\n{text}"))
def test_an_outline_is_made_of_everything_that_python_reads(text: str) -> None:
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return
    found = outline(tree, "bot/node.py", "bot.node")
    assert found.classes[0].bases == ("B", "c.d", "e", "f")


def test_a_deep_tree_is_outlined() -> None:
    text = "x = " + "a." * 400 + "b\n" + "".join(f"{' ' * n}class A{n}:\n" for n in range(60))
    found = outline(ast.parse(text + " " * 60 + "pass\n"), "n.py", "n")
    assert len(found.classes) == 60


@pytest.mark.parametrize(
    "text",
    ['name = {"a": 1}\nprint(f"{name["a"]}")\n', "x = 1\ntype Speed = float\n"],
)
def test_syntax_of_jazzy_s_python_is_distinguished_from_a_mistake(
    tmp_path: Path, text: str
) -> None:
    (tmp_path / "node.py").write_text(text)
    [error] = newer_syntax(tmp_path, ["node.py"], python=(3, 11))
    assert (error.file, error.line) == ("node.py", 2)
    assert "added in Python 3.12" in error.message
    assert newer_syntax(tmp_path, ["node.py"], python=(3, 12)) == ()


@pytest.mark.parametrize(
    "text",
    [
        "def f(:\n    pass\n",
        "type Speed = float\ndef f(:\n",
        "print 'hello'\n",
        "x = t'{1}'\n",
    ],
)
def test_what_no_python_of_jazzy_reads_is_a_mistake(tmp_path: Path, text: str) -> None:
    (tmp_path / "node.py").write_text(text)
    assert newer_syntax(tmp_path, ["node.py"], python=(3, 11)) == ()
