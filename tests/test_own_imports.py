"""A sourced workspace never takes the place of rosgrade or of its libraries."""

from __future__ import annotations

import os
import subprocess
import sysconfig
import venv
from pathlib import Path

import pytest

from grader.machine import ros
from grader.run.cell.discovery_probe import discovery_time_s

ROOT = Path(__file__).resolve().parents[1]
HIDING = ("grader", "sim", "rich", "typer")


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with rosgrade in it, as pip leaves it."""
    folder = tmp_path_factory.mktemp("environment") / ".venv"
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python3*/site-packages")
    places = [str(ROOT), sysconfig.get_path("purelib")]
    (site / "_rosgrade.pth").write_text("\n".join(places), encoding="utf-8")
    (site / "rosgrade_own_imports.pth").symlink_to(ROOT / "grader/own_imports.pth")
    command = folder / "bin" / "rosgrade"
    command.write_text(f"#!{folder}/bin/python\nfrom grader.__main__ import main\nmain()\n")
    command.chmod(0o755)
    return folder


@pytest.fixture
def shell(tmp_path: Path) -> dict[str, str]:
    """Variables of a shell with a workspace whose packages are called like rosgrade's."""
    for name in HIDING:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"print('the workspace has {name}')\n")
    return {**os.environ, "PYTHONPATH": str(tmp_path)}


def run(shell: dict[str, str], *command: str | Path) -> str:
    done = subprocess.run(command, env=shell, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("program", ["bin/rosgrade", "bin/python -m grader", "link"])
def test_a_package_of_a_workspace_that_is_called_like_one_of_ours_hides_nothing(
    environment: Path, shell: dict[str, str], tmp_path: Path, program: str
) -> None:
    (tmp_path / "rosgrade").symlink_to(environment / "bin" / "rosgrade")
    path, *options = program.split()
    first = tmp_path / "rosgrade" if path == "link" else environment / path
    told = run(shell, first, *options, "list")
    assert "timed_publisher" in told and "the workspace has" not in told


def test_a_program_of_the_workspace_imports_its_own_package(
    environment: Path, shell: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "node.py").write_text("import sim\n", encoding="utf-8")
    told = run(shell, environment / "bin" / "python", tmp_path / "node.py")
    assert told == "the workspace has sim\n"


@pytest.mark.ros
def test_a_cell_that_is_started_in_such_a_package_imports_nothing_of_it(
    shell: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Python looks first in the folder in which it is started.
    monkeypatch.chdir(shell["PYTHONPATH"])
    assert discovery_time_s(ros.find()) > 0.0
