"""What a user does with the output of a command changes neither its work nor its status."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import ROOT

ROSGRADE = f"{sys.executable} -m grader"
REFERENCE = ROOT / "reference" / "timed_publisher"
CHECK = f"{ROSGRADE} check timed_publisher {REFERENCE} --report report"


def shell(folder: Path, command: str) -> subprocess.CompletedProcess[str]:
    """Run a line of bash in a folder."""
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", f"export PYTHONPATH={ROOT}; {command}"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


@pytest.mark.parametrize(
    "redirected",
    [
        "2>&1 | head -1",
        "2>/dev/full",
    ],
)
def test_a_check_is_done_and_keeps_its_status(tmp_path: Path, redirected: str) -> None:
    ended = shell(tmp_path, f"{CHECK} {redirected}")
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr
    assert (tmp_path / "report" / "report.html").is_file()


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (
            "OSError(28, 'No space')",
            "rosgrade: error: this machine: the disk is full",
        ),
        ("KeyError('a bug')", "Traceback"),
    ],
)
def test_a_bug_and_a_broken_machine_never_look_like_lost_points(
    tmp_path: Path, raised: str, said: str
) -> None:
    broken = f"(_ for _ in ()).throw({raised})"
    program = f"from grader.cli import app; app.app = lambda: {broken}; app.main()"
    ended = shell(tmp_path, f'{sys.executable} -c "{program}"')
    assert ended.returncode == 3
    assert ended.stderr.startswith(said)


def test_signals_that_the_caller_has_blocked_hold_nothing_up(tmp_path: Path) -> None:
    block = "import os, signal, sys; signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGCHLD])"
    program = f"{block}; os.execvp(sys.argv[1], sys.argv[1:])"
    ended = shell(tmp_path, f"{sys.executable} -c '{program}' {CHECK} --sandbox none")
    assert ended.returncode == 0, ended.stderr


def test_output_that_is_lost_on_a_full_disk_is_reported(tmp_path: Path) -> None:
    ended = shell(tmp_path, f"{ROSGRADE} list >/dev/full")
    assert ended.returncode == 3
    assert "standard output cannot be written: No space left on device" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_output_that_is_not_read_to_the_end_is_no_fault(tmp_path: Path) -> None:
    ended = shell(tmp_path, f"{ROSGRADE} schema | head -1")
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "{\n", "")
