"""What the tutorial asks its reader to do: write files, run commands, compare what they print."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from grader.machine import resources

_FENCE = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_TITLE = re.compile(r'title="([^"]+)"')


@dataclass(frozen=True)
class WriteFile:
    """A block with a title: the whole content of a file."""

    path: str
    content: str


@dataclass(frozen=True)
class Command:
    """A line after a prompt, with what it is said to print."""

    line: str
    printed: str

    @property
    def words(self) -> list[str]:
        """The command as a list of arguments."""
        return shlex.split(self.line)

    def printed_by(self, output: str) -> bool:
        """Whether the output is what the page shows; `...` stands for anything, also nothing.

        How wide a table is does not count: any space is as good as another.
        """
        parts = [re.escape(_spaced(part)) for part in self.printed.split("...")]
        return re.fullmatch(r"\s*.*?\s*".join(parts), _spaced(output), re.DOTALL) is not None


def _spaced(text: str) -> str:
    return " ".join(text.split())


def steps(page: str, skipped: Collection[str] = ()) -> list[WriteFile | Command]:
    """All steps of a page, in order."""
    found: list[WriteFile | Command] = []
    for language, rest, block in _FENCE.findall(page):
        title = _TITLE.search(rest)
        if title:
            found.append(WriteFile(title[1], block))
        elif language == "console":
            for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
                line, _, printed = part.partition("\n")
                found.append(Command(line, printed))
        elif language not in skipped:
            raise ValueError(f"a block that no step is made of: {language}{rest}")
    return found


def run(step: Command, folder: Path, ends_with: int = 0) -> None:
    """Do what a reader does, and see that it prints and ends as the page says."""
    words = step.words
    is_ours = words[0] == "rosgrade"
    ended = subprocess.run(
        [sys.executable, "-m", "grader", *words[1:]] if is_ours else words,
        cwd=folder,
        env={**os.environ, "COLUMNS": "100", "PYTHONPATH": str(resources.root())},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=1200,
        check=False,
    )
    told = f"$ {step.line}\n{ended.stdout}"
    assert ended.returncode == ends_with, told
    assert step.printed_by(ended.stdout), told
