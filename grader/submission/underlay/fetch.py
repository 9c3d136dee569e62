"""Repositories of a ``.repos`` file: fetched once by git, at a version that does not move.

What is fetched stays in ``sources/`` of the folder of underlays, so that an interrupted command
goes on where it stopped and nothing is fetched again for another ROS installation.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from grader.errors import GraderFault, UsageError
from grader.submission.git import run_git
from grader.submission.underlay.definition import Repository

_SOURCES, _FILES, _COMMIT = "sources", "files", "commit"
_FETCH_S = 600.0
_HASH = re.compile(r"[0-9a-f]{40}")
_REF = re.compile(r"^([0-9a-f]{40})\trefs/(tags|heads)/(\S+)$", re.MULTILINE)


def fetch(
    name: str,
    repository: Repository,
    folder: Path,
    answer_s: float,
    on_progress: Callable[[str], None],
) -> Path:
    """The files of a repository.

    Args:
        folder: The folder of underlays.
        answer_s: Longest time until the server answers.

    Raises:
        UsageError: It has no such version, or the version moves, or is not the commit.
        GraderFault: It cannot be reached.
    """
    version, url = repository.version, repository.url
    key = hashlib.sha256(f"{url}\0{version}".encode()).hexdigest()[:32]
    place = folder / _SOURCES / key
    if not (place / _COMMIT).is_file():
        on_progress(f"fetching {name} {version} from {url}")
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".unfinished-", dir=place.parent) as scratch:
            try:
                _fetch(repository, Path(scratch, "whole"), answer_s)
            except GraderFault as fault:
                raise GraderFault(f"{name}: {fault}") from fault
            shutil.rmtree(place, ignore_errors=True)
            Path(scratch, "whole").rename(place)
    commit = (place / _COMMIT).read_text(encoding="ascii")
    if repository.commit not in (None, commit):
        shutil.rmtree(place)
        raise UsageError(
            f"{name}: the tag {version} of {url} is the commit {commit}, not {repository.commit}, "
            "which this underlay was made for: it was moved, or this is another repository"
        )
    return place / _FILES


def commit_of(files: Path) -> str:
    """The commit of a repository that :func:`fetch` fetched."""
    return (files.parent / _COMMIT).read_text(encoding="ascii")


def _fetch(repository: Repository, folder: Path, answer_s: float) -> None:
    files = folder / _FILES
    files.mkdir(parents=True)
    run_git(["init", "--quiet"], files, answer_s)
    reference = _reference(repository, files, answer_s)
    options = ["--quiet", "--depth", "1", "--no-tags", "--no-recurse-submodules"]
    run_git(["fetch", *options, "--", repository.url, reference], files, _FETCH_S)
    run_git(["checkout", "--quiet", "--detach", "FETCH_HEAD"], files, _FETCH_S)
    commit = run_git(["rev-parse", "HEAD"], files, answer_s).strip()
    shutil.rmtree(files / ".git")
    (folder / _COMMIT).write_text(commit, encoding="ascii")


def _reference(repository: Repository, folder: Path, answer_s: float) -> str:
    """What has to be fetched; asks the server, which may not answer."""
    version, url = repository.version, repository.url
    is_commit = _HASH.fullmatch(version)
    wanted = ["HEAD"] if is_commit else [f"refs/tags/{version}", f"refs/heads/{version}"]
    answer = run_git(["ls-remote", "--", url, *wanted], folder, answer_s)
    found = {kind: commit for commit, kind, _ in _REF.findall(answer)}
    if is_commit:
        return version
    if "tags" in found:
        return f"refs/tags/{version}"
    if "heads" in found:
        raise UsageError(
            f"{version} is a branch of {url}, which moves: name a tag, or the commit that it is at "
            f"now, version: {found['heads']}"
        )
    raise UsageError(f"{url} has no tag {version!r}; a commit is written with all of its 40 digits")
