"""The command ``ros2`` beside rosgrade's Python, where it comes from an underlay."""

from __future__ import annotations

import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path

from grader.errors import GraderFault
from grader.machine.ros import RosInstallation, find
from grader.submission.underlay.store import UnderlayStore

_MARK = "# Written by `rosgrade underlay`: runs ros2 from the underlay in rosgrade's cache."
_NAMED = re.compile(r"\bros2 [a-z]")
_OF_PYTHON = ("PATH", "PYTHONNOUSERSITE")

REMEDY = "`rosgrade underlay add ros2cli` builds it in about a minute, from sources on GitHub"


def write_command(ros: RosInstallation, store: UnderlayStore) -> Path | None:
    """Write, renew or remove the command; its path where it was not there before.

    A sourced ROS has its own.
    """
    file = ros.python.parent / "ros2"
    if ros.source != "wheels" or (file.exists() and not _is_ours(file)):
        return None
    kept = store.installed()
    program = next((prefix for one, prefix in kept if "ros2cli" in one.packages), None)
    if program is None:
        if not _runs(file):
            file.unlink(missing_ok=True)
        return None
    environment = replace(ros, underlays=tuple(prefix for _, prefix in kept)).environment({})
    lines = ["#!/bin/sh", _MARK]
    for name, value in sorted(environment.items()):
        # A workspace that was sourced in the shell comes first.
        sourced = f'"${{{name}:+${name}:}}"' if name.endswith("PATH") else ""
        if name not in _OF_PYTHON:
            lines.append(f"export {name}={sourced}{shlex.quote(value)}")
    lines.append(f'exec {shlex.join([str(ros.python), str(program / "bin/ros2")])} "$@"')
    is_new = not file.exists()
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    file.chmod(0o755)
    return file if is_new else None


def find_command(ros: RosInstallation) -> Path | None:
    """Where ``ros2`` is on this machine: beside rosgrade's Python, or on the PATH."""
    file = ros.python.parent / "ros2"
    found = str(file) if file.is_file() else shutil.which("ros2")
    return Path(found) if found else None


def absence_note(text: str) -> str:
    """What to add to a text that names the command where there is none; else nothing."""
    if not _NAMED.search(text):
        return ""
    try:
        if find_command(find()) is not None:
            return ""
    except GraderFault:
        # There is no ROS at all, and what needs it says so.
        return ""
    return (
        f"The command `ros2` is not on this machine: {REMEDY}. Without it, `rosgrade check` runs "
        "your nodes, and with --verbose shows what they print."
    )


def _runs(file: Path) -> bool:
    """Whether what the command runs is still there, such as the build of an earlier rosgrade."""
    if not file.is_file():
        return False
    last = file.read_text(encoding="utf-8", errors="replace").splitlines()[-1]
    return Path(shlex.split(last)[-2]).is_file()


def _is_ours(file: Path) -> bool:
    return _MARK in file.read_text(encoding="utf-8", errors="replace")
