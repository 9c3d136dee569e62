"""The tables of mistakes, and of what to try."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from importlib import import_module
from string import Template

import pytest

from grader.diagnosis.explanation import hints, mistaken, mistakes, remedy
from grader.findings.words import TERMS, Words, speaking
from grader.machine import resources
from grader.recording.submission import CPP
from grader.spec.source import read_source

MISTAKES = {name: one for about in mistakes().values() for name, one in about.items()}


def sources() -> Iterator[ast.Module]:
    for folder in ("checks", "diagnosis"):
        for file in (resources.root() / "grader" / folder).rglob("*.py"):
            yield ast.parse(file.read_text(encoding="utf-8"))


def named() -> Iterator[tuple[str, set[str]]]:
    """Each mistake that is named in a call, with the texts that it is given."""
    for tree in sources():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("mistaken", "remedy"):
                name = node.args[0]
                if isinstance(name, ast.Constant):
                    yield str(name.value), {str(one.arg) for one in node.keywords}


def wanted(hint: str | Words) -> set[str]:
    texts = [hint] if isinstance(hint, str) else [hint.python, hint.cpp]
    found = [Template.pattern.findall(text) for text in texts]
    names = {one[1] or one[2] for some in found for one in some}
    # A dollar that stands for itself names nothing.
    return names - {*TERMS, ""}


def test_every_mistake_that_is_named_is_in_a_table() -> None:
    assert {name for name, _ in named()} <= hints().keys()


def test_every_mistake_of_the_tables_is_named() -> None:
    texts = {
        node.value
        for tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
    }
    assert hints().keys() <= texts
    assert len(MISTAKES) == sum(map(len, mistakes().values()))


def test_no_two_mistakes_have_one_name() -> None:
    explained = read_source(resources.root() / "grader/diagnosis/hints.yaml").data
    names = [*MISTAKES, *(name for one in explained.values() for name in one)]
    assert len(names) == len(set(names)) == len(hints())


def test_each_hint_of_an_explanation_stands_below_its_module() -> None:
    for module in read_source(resources.root() / "grader/diagnosis/hints.yaml").data:
        assert import_module(f"grader.diagnosis.{module}")


def test_every_text_that_a_hint_asks_for_is_given() -> None:
    for name, given in named():
        if "None" not in given:
            assert wanted(hints()[name]) <= given, name


@pytest.mark.parametrize("name", MISTAKES)
def test_every_mistake_is_one_plain_sentence(name: str) -> None:
    assert re.fullmatch(r"\S.*[.]", MISTAKES[name].mistake)
    assert len(MISTAKES[name].mistake) <= 110


def test_a_hint_says_its_terms_in_the_language_and_what_it_is_given_as_it_is() -> None:
    finding = mistaken("once_per_call", "it did")
    assert finding.observed == "it did" and finding.hint.startswith("Publish once")
    assert "time.sleep()" in remedy("slow_callback")
    with speaking(CPP):
        assert "std::this_thread::sleep_for()" in remedy("slow_callback")
        assert "`$SLEEP`" in remedy("other_use", name="$SLEEP")
