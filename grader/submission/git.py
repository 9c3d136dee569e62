"""git, bounded in time: runs nothing that a repository brings along, and asks for no password."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from grader.errors import GraderFault
from grader.submission.build.bounded import Command, run_bounded
from grader.submission.intake.paths import shown

_SAFE = {
    "core.hooksPath": "/dev/null",
    "core.fsmonitor": "false",
    # Else the program that the repository names for signatures is run.
    "log.showSignature": "false",
    "protocol.ext.allow": "never",
    # A server that sends nothing for so long is given up.
    "http.lowSpeedLimit": "1",
    "http.lowSpeedTime": "30",
}
_QUIET = {"GIT_TERMINAL_PROMPT": "0", "GIT_LFS_SKIP_SMUDGE": "1", "LC_ALL": "C"}
# Where a hook of another repository calls rosgrade.
_FOREIGN = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE")


def run_git(arguments: list[str], folder: Path, wall_s: float) -> str:
    """Run git in a folder; what it prints.

    Raises:
        GraderFault: It failed, or took longer than ``wall_s``.
    """
    git = shutil.which("git")
    if git is None:
        raise GraderFault("git is not installed")
    settings = [part for key, value in _SAFE.items() for part in ("-c", f"{key}={value}")]
    environment = {key: value for key, value in os.environ.items() if key not in _FOREIGN}
    command = Command([git, *settings, *arguments], folder, environment | _QUIET)
    done = run_bounded(command, wall_s=wall_s)
    if done.ended_by_us:
        raise GraderFault(f"git {arguments[0]} took longer than {wall_s:.0f} s")
    if done.status:
        # Advice follows below the reason.
        lines = done.output.strip().split("\n")
        reason = next((line for line in lines if line.startswith("fatal: ")), lines[-1])
        raise GraderFault(f"git {arguments[0]} failed: {shown(reason.removeprefix('fatal: '))}")
    return done.output
