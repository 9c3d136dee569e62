"""What colcon, Python, git, editors and macOS leave behind: never a student's work."""

from __future__ import annotations

import re
from collections.abc import Set
from fnmatch import fnmatch

from grader.submission.intake.paths import parents
from grader.submission.read.manifest import MANIFEST

_TOOLS = """
.git .hg .svn __pycache__ .venv node_modules .pytest_cache .mypy_cache .ruff_cache .hypothesis .tox
.colcon CMakeFiles __MACOSX rosgrade-report
"""
TOOL_FOLDERS = frozenset(_TOOLS.split())
"""Folders that tools make, wherever they are."""

COLCON_FOLDERS = ("build", "install", "log")
_COLCON_MARKS = {
    "COLCON_IGNORE",
    ".built_by",
    ".colcon_install_layout",
    "local_setup.sh",
    "CMakeCache.txt",
}
_VIRTUAL_ENVIRONMENT = "pyvenv.cfg"
MARKS = (*_COLCON_MARKS, _VIRTUAL_ENVIRONMENT, MANIFEST)
"""Files that tell what a folder is."""

_EDITORS = re.compile(
    r"""
    .*~ | .*\.sw[a-z] | 4913                                     # backups, Vim
    | \.\#.* | \#.*\# | flycheck_.*                              # Emacs
    | \.goutputstream-.* | .*\.kate-swp | .*___jb_(tmp|old)___   # gedit, Kate, JetBrains
    """,
    re.VERBOSE | re.DOTALL,
)


# What git and macOS add without being asked is not among them.
_MADE = (
    *("__pycache__", "*.pyc", "*.egg-info", ".venv", "venv", "node_modules"),
    *(".pytest_cache", ".mypy_cache", ".ruff_cache", "CMakeFiles"),
)


def built(path: str) -> str | None:
    """The folder that a build, a run or a test made, of a path that is left out; or None."""
    for folder in (*reversed(parents(path)), path):
        name = folder.rpartition("/")[2]
        if any(fnmatch(name, pattern) for pattern in _MADE):
            return folder
    return path if path.rpartition("/")[2] in COLCON_FOLDERS else None


def is_left_out(path: str) -> bool:
    """Whether a path is something that a tool, an editor or macOS left behind."""
    parts = path.split("/")
    return (
        not TOOL_FOLDERS.isdisjoint(parts)
        or parts[-1] == ".DS_Store"
        or parts[-1].startswith("._")
        or _EDITORS.fullmatch(parts[-1]) is not None
    )


def is_leftover(name: str, marks: Set[str], in_package: bool) -> bool:
    """Whether a folder is something that a tool left behind.

    Args:
        marks: Those of ``MARKS`` that are in it.
    """
    if name in TOOL_FOLDERS or name.endswith(".egg-info") or _VIRTUAL_ENVIRONMENT in marks:
        return True
    if name not in COLCON_FOLDERS:
        return False
    # A package may well have a module called "log"; a workspace has no use for another "log".
    return bool(marks & _COLCON_MARKS) or not (in_package or MANIFEST in marks)
