"""Folders that programs of others have filled, perhaps with folders in folders without end.

What walks through a tree by recursion stops with a RecursionError in one that is deep enough, and
a path may be too long for the system. So what lies too deep is taken away before anybody looks.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

MOST_DEEP = 100
"""Folders in one another. What colcon makes of a package with interfaces is 9 deep."""
_LONGEST_PATH = 3000
"""In bytes; the system takes 4096, and what walks here appends names to it."""


def remove_tree(path: Path) -> None:
    """Remove a folder with all that is in it, however deep that is; what cannot go, stays."""
    try:
        shutil.rmtree(path, ignore_errors=True)
    except RecursionError:
        _remove_deep(path)


def cut_deep(folder: Path) -> bool:
    """Remove what lies too deep in a folder.

    Args:
        folder: Nobody writes to it any more.

    Returns:
        Whether there was anything.
    """
    found = False
    ahead = [(os.fsencode(folder), 0)]
    while ahead:
        path, depth = ahead.pop()
        try:
            entries = [entry for entry in os.scandir(path) if entry.is_dir(follow_symlinks=False)]
        except OSError:
            continue
        for entry in entries:
            if depth < MOST_DEEP and len(entry.path) <= _LONGEST_PATH:
                ahead.append((entry.path, depth + 1))
            else:
                found = True
                _remove_deep(Path(os.fsdecode(entry.path)))
    return found


def _remove_deep(path: Path) -> None:
    # It goes from folder to folder, with neither recursion nor the whole path.
    subprocess.run(["rm", "-rf", "--", path], stderr=subprocess.DEVNULL, check=False)
