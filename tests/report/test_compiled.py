"""Compiled templates are kept, and nothing depends on it."""

from __future__ import annotations

from pathlib import Path

import pytest
from jinja2 import DictLoader, Environment

from grader.report.html.compiled import CompiledTemplates


def rendered(folder: Path, source: str) -> str:
    environment = Environment(
        loader=DictLoader({"page": source}), bytecode_cache=CompiledTemplates(folder)
    )
    return environment.get_template("page").render(name="bot")


def test_a_template_is_kept_and_a_changed_one_is_compiled_anew(tmp_path: Path) -> None:
    folder = tmp_path / "cache" / "templates"
    assert rendered(folder, "{{ name }} passed") == "bot passed"
    assert list(folder.iterdir())
    assert rendered(folder, "{{ name }} passed") == "bot passed"
    assert rendered(folder, "{{ name }} failed") == "bot failed"


@pytest.mark.parametrize("content", [b"", b"no bytecode"])
def test_a_broken_file_does_no_harm(tmp_path: Path, content: bytes) -> None:
    rendered(tmp_path, "{{ name }} passed")
    for file in tmp_path.iterdir():
        file.write_bytes(content)
    assert rendered(tmp_path, "{{ name }} passed") == "bot passed"


def test_a_folder_that_cannot_be_made_does_no_harm(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert rendered(tmp_path / "file" / "templates", "{{ name }} passed") == "bot passed"
