"""Nothing of an earlier run stays behind in /tmp, however it ended."""

from __future__ import annotations

import errno
import fcntl
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from grader.errors import machine_fault
from grader.machine.scratch import Scratch, remove_stale

HOLDS = """
import sys, tempfile
tempfile.tempdir = sys.argv[1]
from grader.errors import machine_fault
from grader.machine.scratch import Scratch
scratch = Scratch("test")
(scratch.path / "file").touch()
print(scratch.path, flush=True)
input()
"""


def test_it_is_gone_after_its_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with Scratch("test") as path:
        (path / "file").touch()
    assert list(tmp_path.iterdir()) == []
    twice = Scratch("test")
    twice.remove()
    twice.remove()
    assert list(tmp_path.iterdir()) == []


def test_what_is_still_written_while_it_is_removed_is_no_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    remove_folder = os.rmdir

    def late(path: str, *, dir_fd: int | None = None) -> None:
        folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY, dir_fd=dir_fd)
        os.close(os.open("late", os.O_CREAT, dir_fd=folder))
        os.close(folder)
        remove_folder(path, dir_fd=dir_fd)

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with Scratch("test") as path:
        (path / "cell").mkdir()
        monkeypatch.setattr(os, "rmdir", late)
    monkeypatch.undo()
    assert (path / "cell" / "late").exists()
    remove_stale(tmp_path, age_s=0.0)
    assert list(tmp_path.iterdir()) == []


def test_where_no_temporary_file_can_be_written_one_sentence_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", lambda: [str(tmp_path / "gone")])
    with pytest.raises(FileNotFoundError) as raised:
        Scratch("test")
    fault = str(machine_fault(raised.value))
    assert "set TMPDIR to a folder with room" in fault
    assert "[" not in fault


def test_what_a_killed_process_left_goes_and_what_is_held_stays(tmp_path: Path) -> None:
    (tmp_path / "rosgrade-report").mkdir()
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDS, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    path = Path(process.stdout.readline().strip())
    remove_stale(tmp_path, age_s=0.0)
    assert (path / "file").exists()
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    remove_stale(tmp_path)
    assert path.exists()
    remove_stale(tmp_path, age_s=0.0)
    assert [item.name for item in tmp_path.iterdir()] == ["rosgrade-report"]


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.mkdir()
    (tmp_path / "rosgrade-scratch-x").symlink_to(precious)
    remove_stale(tmp_path, age_s=0.0)
    assert precious.is_dir()


def test_a_file_system_without_locks_is_no_obstacle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_file: int, _how: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(fcntl, "flock", refuse)
    with Scratch("test") as path:
        remove_stale(tmp_path, age_s=0.0)
        assert path.is_dir()
