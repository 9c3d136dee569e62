"""Folders that are nested without end are removed, and stop no program."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.machine.scratch import PREFIX, Scratch, remove_stale
from grader.machine.tree import MOST_DEEP, cut_deep, remove_tree
from grader.submission.prepare import fingerprint

MORE_THAN_PYTHON_RECURS = 1200


def dig(folder: Path, depth: int, name: str = "d") -> None:
    """Make nested folders, even if their path is too long for the system."""
    folder.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(folder, os.O_RDONLY)
    for _ in range(depth):
        os.mkdir(name, dir_fd=descriptor)
        inner = os.open(name, os.O_RDONLY, dir_fd=descriptor)
        os.close(descriptor)
        descriptor = inner
    os.close(descriptor)


@pytest.fixture
def deep(tmp_path: Path) -> Iterator[Path]:
    """A folder that is gone afterwards; pytest itself could not remove it."""
    folder = tmp_path / "deep"
    dig(folder, MORE_THAN_PYTHON_RECURS)
    yield folder
    remove_tree(folder)


def test_a_deep_tree_is_removed(deep: Path) -> None:
    remove_tree(deep)
    assert not deep.exists()


@pytest.mark.parametrize("name", ["d", "n" * 250])
def test_what_lies_too_deep_is_cut_off_and_all_else_stays(name: str, tmp_path: Path) -> None:
    dig(tmp_path / "deep", 200, name)
    dig(tmp_path / "flat", MOST_DEEP - 1)
    (tmp_path / "deep" / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "deep")
    assert cut_deep(tmp_path)
    assert (tmp_path / "deep" / "file").exists() and (tmp_path / "deep" / name).is_dir()
    assert len(list((tmp_path / "flat").rglob("d"))) == MOST_DEEP - 1
    assert len(list((tmp_path / "deep").rglob(name))) < MOST_DEEP
    assert not cut_deep(tmp_path)


def test_no_mode_keeps_its_owner_from_reading_a_tree(tmp_path: Path) -> None:
    file, locked, link = tmp_path / "a" / "b" / "file", tmp_path / "a", tmp_path / "link"
    file.parent.mkdir(parents=True)
    file.touch()
    link.symlink_to(tmp_path.parent)
    before = tmp_path.parent.stat().st_mode
    for path in (file, file.parent, locked):
        path.chmod(0o010)
    assert not cut_deep(tmp_path)
    assert [path.stat().st_mode & 0o777 for path in (locked, file.parent, file)] == [
        0o710,
        0o710,
        0o410,
    ]
    assert tmp_path.parent.stat().st_mode == before


def test_a_scratch_folder_is_gone_however_deep_it_is() -> None:
    with Scratch("test") as scratch:
        dig(scratch / "deep", MORE_THAN_PYTHON_RECURS)
    assert not scratch.exists()


def test_what_a_killed_process_left_stops_no_other(tmp_path: Path) -> None:
    stale = tmp_path / f"{PREFIX}test"
    dig(stale, MORE_THAN_PYTHON_RECURS)
    os.utime(stale, (0, 0))
    remove_stale(tmp_path)
    assert not stale.exists()


def test_a_submission_that_is_too_deep_has_a_hash_all_the_same(deep: Path) -> None:
    assert fingerprint(deep) == fingerprint(deep)
