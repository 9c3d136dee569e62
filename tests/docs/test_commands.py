"""Commands that the documentation names exist, with the options that it names."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from typing import Any

import pytest
import typer.main

from grader.cli.app import app
from grader.machine import resources

ROOT = resources.root()
INDENTED = re.compile(r"^ {4,}(rosgrade .*)$", re.MULTILINE)
FENCE = re.compile(r"^( *)```\w*[^\n]*\n(.*?)^\1```", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"`(rosgrade\s[^`]+)`")
PAGES = ["README.md", *(str(page.relative_to(ROOT)) for page in (ROOT / "docs").rglob("*.md"))]


def named(text: str) -> list[str]:
    """Command lines in code blocks and in running text."""
    lines = [line.strip() for _, block in FENCE.findall(text) for line in block.splitlines()]
    lines = [line.removeprefix("$ ") for line in lines]
    lines += INDENTED.findall(FENCE.sub("", text))
    lines += [" ".join(found.split()) for found in INLINE.findall(text)]
    return [line.partition(" #")[0].strip() for line in lines if line.startswith("rosgrade ")]


def test_commands_are_found_in_blocks_and_in_text() -> None:
    text = "Use `rosgrade\ndoctor` and:\n\n```console\n$ rosgrade list   # all\nother\n```\n"
    text += "rosgrade itself:\n\n    rosgrade show x\n"
    assert named(text) == ["rosgrade list", "rosgrade show x", "rosgrade doctor"]


@pytest.mark.parametrize("page", PAGES)
def test_named_commands_and_options_exist(page: str) -> None:
    for line in named((ROOT / page).read_text(encoding="utf-8")):
        words = shlex.split(line.replace("...", ""))[1:]
        command: Any = typer.main.get_command(app)
        while hasattr(command, "commands") and words and not words[0].startswith("-"):
            assert words[0] in command.commands, line
            context = command.make_context("rosgrade", [], resilient_parsing=True)
            _, command, words = command.resolve_command(context, words)
        known = {option for parameter in command.params for option in parameter.opts}
        asked = {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert asked <= known | {"-h", "--help"}, line


def test_the_help_of_a_command_begins_with_its_line_in_the_list() -> None:
    command: Any = typer.main.get_command(app)
    context = command.make_context("rosgrade", [], resilient_parsing=True)
    for name in command.list_commands(context):
        _, called, rest = command.resolve_command(context, [name])
        assert (called.help, rest) == (command.get_command(context, name).help, []), name


def test_the_list_of_commands_imports_none_of_them() -> None:
    program = (
        "import sys; from grader.cli.app import app; app(['--help'], standalone_mode=False); "
        "sys.exit(any(name in sys.modules for name in ('pydantic', 'grader.cli.check')))"
    )
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=True, capture_output=True)
