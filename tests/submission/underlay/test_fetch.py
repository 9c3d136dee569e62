"""Sources of underlays come from git once, at a version that does not move."""

from __future__ import annotations

import shutil
import socket
from pathlib import Path

import pytest

from grader.errors import GraderFault, UsageError
from grader.submission.underlay.definition import Repository as Wanted
from grader.submission.underlay.fetch import fetch
from tests.submission.underlay.conftest import Repository


def fetched(
    url: str, version: str, cache: Path, commit: str | None = None, answer_s: float = 20.0
) -> Path:
    wanted = Wanted.model_validate(
        {"type": "git", "url": url, "version": version, "commit": commit}
    )
    return fetch("robots", wanted, cache, answer_s, lambda _: None)


def test_a_tag_is_fetched_without_git_s_own_files_and_only_once(
    repository: Repository, tmp_path: Path
) -> None:
    commit = repository.commit("arm", tag="1.0.0")
    files = fetched(repository.url, "1.0.0", tmp_path / "cache", commit)
    assert sorted(path.name for path in files.iterdir()) == ["arm"]
    shutil.rmtree(repository.folder)
    assert fetched(repository.url, "1.0.0", tmp_path / "cache", commit) == files


def test_a_commit_that_no_tag_names_is_fetched(repository: Repository, tmp_path: Path) -> None:
    commit = repository.commit("arm", tag="1.0.0")
    repository.commit("leg", tag="2.0.0")
    files = fetched(repository.url, commit, tmp_path)
    assert not (files / "leg").exists()


def test_a_branch_is_refused_with_the_commit_that_it_is_at(
    repository: Repository, tmp_path: Path
) -> None:
    commit = repository.commit("arm", tag="1.0.0")
    with pytest.raises(UsageError, match=rf"main is a branch of .*, which moves: .*{commit}"):
        fetched(repository.url, "main", tmp_path)


def test_a_tag_that_was_moved_is_refused(repository: Repository, tmp_path: Path) -> None:
    commit = repository.commit("arm", tag="1.0.0")
    other = commit.translate(str.maketrans("0123456789abcdef", "123456789abcdef0"))
    for _ in range(2):
        with pytest.raises(UsageError, match=rf"is the commit {commit}, not {other}"):
            fetched(repository.url, "1.0.0", tmp_path, other)


def test_a_version_that_is_not_there_is_named(repository: Repository, tmp_path: Path) -> None:
    repository.commit("arm", tag="1.0.0")
    with pytest.raises(UsageError, match=r"has no tag '1\.0'"):
        fetched(repository.url, "1.0", tmp_path)


def test_a_repository_that_is_not_there_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(GraderFault, match=r"robots: git ls-remote failed: .*nowhere"):
        fetched(f"file://{tmp_path}/nowhere", "1.0.0", tmp_path)


def test_a_server_that_never_answers_is_given_up(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"git://127.0.0.1:{server.getsockname()[1]}/robots"
        with pytest.raises(GraderFault, match=r"robots: git ls-remote took longer than 1 s"):
            fetched(url, "1.0.0", tmp_path, answer_s=1.0)
