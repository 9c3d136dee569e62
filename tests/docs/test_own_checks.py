"""The page about checks of one's own is done step by step, and everything happens that it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.machine import resources
from tests.docs.tutorial import WriteFile, run, steps

PAGE = resources.root() / "docs" / "own-checks.md"


def extend(file: Path, content: str) -> None:
    """Do what the page asks: new modules, checks at the end, mutants under `mutants:`."""
    file.parent.mkdir(exist_ok=True)
    before = file.read_text(encoding="utf-8") if file.exists() else ""
    if file.name == "mutants.yaml":
        content = before.replace("mutants:\n", f"mutants:\n{content}\n", 1)
    else:
        content = before + content
    file.write_text(content, encoding="utf-8")


@pytest.mark.ros
@pytest.mark.slow
def test_every_step_does_what_the_page_says(tmp_path: Path) -> None:
    for step in steps(PAGE.read_text(encoding="utf-8"), skipped=("text",)):
        if isinstance(step, WriteFile):
            extend(tmp_path / step.path, step.content)
            continue
        run(step, tmp_path)
    assert not list(tmp_path.rglob("__pycache__"))
