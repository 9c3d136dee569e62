"""Repositories of a ``.repos`` file: fetched once by git, at a version that does not move.

What is fetched stays in ``sources/`` of the folder of underlays, so that an interrupted command
goes on where it stopped and nothing is fetched again for another ROS installation.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from grader.errors import GraderFault, UsageError
from grader.submission.build.bounded import run_bounded
from grader.submission.underlay.definition import Repository

_SOURCES, _FILES, _COMMIT = "sources", "files", "commit"
_FETCH_S = 600.0
_SAFE = {
    "core.hooksPath": "/dev/null",
    "protocol.ext.allow": "never",
    "advice.detachedHead": "false",
    # A server that sends nothing for so long is given up.
    "http.lowSpeedLimit": "1",
    "http.lowSpeedTime": "30",
}
_QUIET = {"GIT_TERMINAL_PROMPT": "0", "GIT_LFS_SKIP_SMUDGE": "1", "LC_ALL": "C"}
# Where git is called by a hook of another repository.
_FOREIGN = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE")
_HASH = re.compile(r"[0-9a-f]{40}")
_REF = re.compile(r"^([0-9a-f]{40})\trefs/(tags|heads)/(\S+)$", re.MULTILINE)


def fetch(
    name: str,
    repository: Repository,
    folder: Path,
    answer_s: float,
    on_progress: Callable[[str], None],
) -> tuple[Path, str]:
    """The files of a repository and its commit.

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
            files = Path(scratch, _FILES)
            files.mkdir()
            reference = _reference(name, repository, answer_s, files)
            _git(["init", "--quiet"], files, answer_s, name)
            options = ["--quiet", "--depth", "1", "--no-tags", "--no-recurse-submodules"]
            _git(["fetch", *options, "--", url, reference], files, _FETCH_S, name)
            _git(["checkout", "--quiet", "FETCH_HEAD"], files, _FETCH_S, name)
            commit = _git(["rev-parse", "HEAD"], files, answer_s, name).strip()
            shutil.rmtree(files / ".git")
            Path(scratch, _COMMIT).write_text(commit, encoding="ascii")
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir()
            for part in (_FILES, _COMMIT):
                Path(scratch, part).rename(place / part)
    commit = (place / _COMMIT).read_text(encoding="ascii")
    if repository.commit not in (None, commit):
        shutil.rmtree(place)
        raise UsageError(
            f"{name}: the tag {version} of {url} is the commit {commit}, not {repository.commit}, "
            "which this underlay was made for: it was moved, or this is another repository"
        )
    return place / _FILES, commit


def _reference(name: str, repository: Repository, answer_s: float, folder: Path) -> str:
    """What has to be fetched; asks the server, which may not answer."""
    version, url = repository.version, repository.url
    is_commit = _HASH.fullmatch(version)
    wanted = ["HEAD"] if is_commit else [f"refs/tags/{version}", f"refs/heads/{version}"]
    answer = _git(["ls-remote", "--", url, *wanted], folder, answer_s, name)
    found = {kind: commit for commit, kind, _ in _REF.findall(answer)}
    if is_commit:
        return version
    if "tags" in found:
        return f"refs/tags/{version}"
    if "heads" in found:
        raise UsageError(
            f"{name}: {version} is a branch of {url}, which moves: name a tag, or the commit that "
            f"it is at now, version: {found['heads']}"
        )
    raise UsageError(
        f"{name}: {url} has no tag {version!r}; a commit is written with all of its 40 digits"
    )


def _git(arguments: list[str], folder: Path, wall_s: float, name: str) -> str:
    """Run git; what it prints."""
    git = shutil.which("git")
    if git is None:
        raise GraderFault("git is not installed: sudo apt install git")
    settings = [part for key, value in _SAFE.items() for part in ("-c", f"{key}={value}")]
    environment = {key: value for key, value in os.environ.items() if key not in _FOREIGN}
    done = run_bounded(
        [git, *settings, *arguments], cwd=folder, environment=environment | _QUIET, wall_s=wall_s
    )
    if done.ended_by_us:
        raise GraderFault(
            f"{name}: the server did not answer within {wall_s:.0f} s (git {arguments[0]}); try "
            "again later: what is complete stays"
        )
    if done.status:
        lines = done.output.strip().split("\n")
        reason = next((line for line in lines if line.startswith("fatal: ")), lines[-1])
        raise GraderFault(f"{name}: git {arguments[0]} failed: {reason.removeprefix('fatal: ')}")
    return done.output
