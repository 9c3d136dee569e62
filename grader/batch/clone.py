"""Cloning what a student handed in as a git repository."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from grader.submission.intake.paths import shown

_CLONE_LIMIT_S = 120.0


def clone(url: str, target: Path) -> str:
    """Clone a repository; says what went wrong, or nothing."""
    options = ["--quiet", "--depth", "1", "--no-recurse-submodules"]
    try:
        _git("clone", *options, "--", url, str(target))
        if _git("-C", str(target), "for-each-ref", "--count=1"):
            return ""
        # Git takes a HEAD that names no branch for an empty repository: after a push of `main` to
        # where HEAD is `master`, nobody may be told to have handed in nothing.
        heads = _git("ls-remote", "--heads", "--", url).split("\n")
        branches = [head.partition("refs/heads/")[2] for head in heads if head]
        if len(branches) == 1:
            shutil.rmtree(target)
            _git("clone", *options, f"--branch={branches[0]}", "--", url, str(target))
    except FileNotFoundError:
        return "git is not installed"
    except subprocess.TimeoutExpired:
        return f"git clone took longer than {_CLONE_LIMIT_S:.0f} s"
    except subprocess.CalledProcessError as error:
        # Below its reason git says what one might look at.
        lines = error.stderr.strip().split("\n")
        reason = next((line for line in lines if line.startswith("fatal: ")), lines[-1])
        return f"git clone failed: {shown(reason.removeprefix('fatal: '))}"
    if len(branches) > 1:
        names = shown(", ".join(branches))
        return f"HEAD of the repository names none of its branches, which are {names}"
    return ""


def _git(*arguments: str) -> str:
    """Run git, which asks for nothing and runs nothing of the repository; gives its output.

    Raises:
        FileNotFoundError: Git is not installed.
        TimeoutExpired: It took too long.
        CalledProcessError: It failed.
    """
    done = subprocess.run(
        ["git", "-c", "core.hooksPath=/dev/null", "-c", "protocol.ext.allow=never", *arguments],
        # What it says is looked for words.
        env={**os.environ, "GIT_TERMINAL_PROMPT": "0", "GIT_LFS_SKIP_SMUDGE": "1", "LC_ALL": "C"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=_CLONE_LIMIT_S,
        check=True,
    )
    return done.stdout
