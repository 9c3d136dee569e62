"""Cloning what a student handed in as a git repository."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from grader.submission.intake.paths import shown

_CLONE_LIMIT_S = 120.0


def clone(url: str, target: Path) -> str:
    """Clone a repository; says what went wrong, or nothing.

    Git asks for nothing, and runs nothing that the repository brings.
    """
    safe = ["-c", "core.hooksPath=/dev/null", "-c", "protocol.ext.allow=never"]
    options = ["--quiet", "--depth", "1", "--no-recurse-submodules"]
    quiet = {"GIT_TERMINAL_PROMPT": "0", "GIT_LFS_SKIP_SMUDGE": "1", "LC_ALL": "C"}
    try:
        subprocess.run(
            ["git", *safe, "clone", *options, "--", url, str(target)],
            env={**os.environ, **quiet},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_CLONE_LIMIT_S,
            check=True,
        )
    except FileNotFoundError:
        return "git is not installed"
    except subprocess.TimeoutExpired:
        return f"git clone took longer than {_CLONE_LIMIT_S:.0f} s"
    except subprocess.CalledProcessError as error:
        # Advice follows below the reason.
        lines = error.stderr.strip().split("\n")
        reason = next((line for line in lines if line.startswith("fatal: ")), lines[-1])
        return f"git clone failed: {shown(reason.removeprefix('fatal: '))}"
    return ""
