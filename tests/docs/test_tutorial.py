"""The tutorial is done step by step, and everything happens that it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.machine import resources
from tests.docs.tutorial import Command, WriteFile, run, steps

PAGE = resources.root() / "docs" / "tutorial.md"
SHOWN_FAILURES = ("WRONG", "✗")


def test_steps_are_files_and_commands_in_order() -> None:
    page = '```yaml title="a/b.yaml"\nx: 1\n```\ntext\n```console\n$ ls a\nb.yaml\n$ true\n```\n'
    assert steps(page) == [
        WriteFile("a/b.yaml", "x: 1\n"),
        Command("ls a", "b.yaml\n"),
        Command("true", ""),
    ]


@pytest.mark.parametrize(
    ("printed", "output", "same"),
    [
        ("Score: 3 of 10\n", "Score:  3 of 10\n", True),
        ("Score: 3 of 10\n", "Score: 4 of 10\n", False),
        ("...\nvalid\n", "a.yaml: valid\n", True),
        ("...\nvalid\n", "a.yaml: valid\nand more\n", False),
        ("ok ... nothing\n", "ok reference what nothing\n", True),
        ("", "warning\n", False),
        ("a.yaml: valid (1)\n", "a.yaml: valid (1)\n", True),
    ],
)
def test_dots_stand_for_anything(printed: str, output: str, same: bool) -> None:
    assert Command("x", printed).printed_by(output) is same


@pytest.mark.ros
@pytest.mark.slow
def test_every_step_does_what_the_page_says(tmp_path: Path) -> None:
    done = steps(PAGE.read_text(encoding="utf-8"))
    assert len(done) > 10
    for step in done:
        if isinstance(step, WriteFile):
            file = tmp_path / step.path
            assert file.is_file(), f"{step.path} is replaced, but is not there"
            file.write_text(step.content, encoding="utf-8")
            continue
        run(step, tmp_path, any(mark in step.printed for mark in SHOWN_FAILURES))
