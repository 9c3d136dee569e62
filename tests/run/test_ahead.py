"""What was imported ahead, in a program that looks for modules in other folders."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from grader.run.environment import TRACER

_PROGRAM = """
import sys
sys.path.append(sys.argv[1])
from _rosgrade_ahead import Ahead
ahead = Ahead()
sys.path.insert(1, sys.argv[2])
ahead.load(("thing",))
ahead.be_as_at_the_start()
sys.path.insert(0, "folder of the program")
sys.path.insert(1, sys.argv[3])
import thing
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """One with a module that tells when it is executed."""
    folder = tmp_path / "libraries"
    folder.mkdir()
    (folder / "thing.py").write_text("print('executed')")
    return folder


def executions(folder: Path, first: Path) -> int:
    """How often the module is executed if a program puts another folder first."""
    command = [sys.executable, "-c", _PROGRAM, str(TRACER), str(folder), str(first)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout.count("executed")


def test_the_same_folder_by_another_name(folder: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(folder)
    assert executions(folder, link) == executions(folder, folder) == 1


def test_another_module_of_that_name(folder: Path, tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    (own / "thing.py").write_text("print('executed')")
    assert executions(folder, own) == 2
