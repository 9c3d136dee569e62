"""git, bounded in time: runs nothing that a repository brings along, and asks for no password."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

from grader.errors import GraderFault
from grader.submission.build.bounded import run_bounded
from grader.submission.intake.paths import shown

_SAFE = {
    "core.hooksPath": "/dev/null",
    "core.fsmonitor": "false",
    "protocol.ext.allow": "never",
    # A server that sends nothing for so long is given up.
    "http.lowSpeedLimit": "1",
    "http.lowSpeedTime": "30",
}
_QUIET = {"GIT_TERMINAL_PROMPT": "0", "GIT_LFS_SKIP_SMUDGE": "1", "LC_ALL": "C"}
# Where a hook of another repository calls rosgrade.
_FOREIGN = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE")
_AUTHOR = {
    f"GIT_{who}_{what}": text
    for who in ("AUTHOR", "COMMITTER")
    for what, text in (("NAME", "rosgrade"), ("EMAIL", "rosgrade@localhost"))
}
_PLUMBING_LIMIT_S = 30.0


def commit_folder(clone: Path, branch: str, folder: str, files: Sequence[Path]) -> bool:
    """Commit files on a branch of a clone; its files and what is checked out stay as they are.

    The branch starts at what is checked out, and is not pushed. False where it has the same
    files already.

    Args:
        folder: The folder in the repository that gets the files.

    Raises:
        GraderFault: It is no clone, or has a branch of that name that is not of this kind.
    """
    dotgit = clone / ".git"
    # A file or a link may lead to any other repository of this machine.
    elsewhere = dotgit.is_symlink() or (dotgit / "commondir").exists()
    if elsewhere or not (clone.is_absolute() and dotgit.is_dir()):
        raise GraderFault(f"{shown(str(clone))} is not a clone")

    with TemporaryDirectory(prefix="rosgrade-") as place:

        def git(*arguments: str) -> str:
            own = {**_AUTHOR, "GIT_INDEX_FILE": f"{place}/index"}
            return run_git(list(arguments), clone, _PLUMBING_LIMIT_S, own).strip()

        ref = f"refs/heads/{branch}"
        tip, _, checked_out = git(
            "for-each-ref", "--format=%(objectname) %(worktreepath)", ref
        ).partition(" ")
        if checked_out or (tip and not git("ls-tree", tip, folder)):
            raise GraderFault(f"has a branch {branch} of its own; use another name")
        start = tip or git("rev-parse", "--verify", "HEAD")
        git("read-tree", start)
        for file in files:
            blob = git("hash-object", "-w", "--no-filters", "--", str(file.resolve()))
            entry = f"100644,{blob},{folder}/{file.name}"
            git("update-index", "--add", "--replace", "--cacheinfo", entry)
        tree = git("write-tree", "--missing-ok")
        if tip and tree == git("rev-parse", f"{tip}^{{tree}}"):
            return False
        commit = git("commit-tree", tree, "-p", start, "-m", "Feedback by rosgrade")
        git("update-ref", ref, commit, tip)
    return True


def run_git(
    arguments: list[str],
    folder: Path,
    wall_s: float,
    added: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Run git in a folder; what it prints.

    Args:
        added: Variables of its environment.

    Raises:
        GraderFault: It failed, or took longer than ``wall_s``.
    """
    git = shutil.which("git")
    if git is None:
        raise GraderFault("git is not installed")
    settings = [part for key, value in _SAFE.items() for part in ("-c", f"{key}={value}")]
    environment = {key: value for key, value in os.environ.items() if key not in _FOREIGN}
    done = run_bounded(
        [git, *settings, *arguments],
        cwd=folder,
        environment={**environment, **_QUIET, **added},
        wall_s=wall_s,
    )
    if done.ended_by_us:
        raise GraderFault(f"git {arguments[0]} took longer than {wall_s:.0f} s")
    if done.status:
        # Advice follows below the reason.
        lines = done.output.strip().split("\n")
        reason = next((line for line in lines if line.startswith("fatal: ")), lines[-1])
        raise GraderFault(f"git {arguments[0]} failed: {shown(reason.removeprefix('fatal: '))}")
    return done.output
