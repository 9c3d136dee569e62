"""Folders that students' programs have filled, perhaps nested too deep to walk through.

Recursion ends with a RecursionError in a tree that is deep enough, and a path may be too long for
the system. So what lies too deep is removed before the folder is read.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import subprocess
from pathlib import Path

MOST_DEEP = 100
"""Folders in one another. What colcon makes of a package with interfaces is 9 deep."""
_LONGEST_PATH = 3000
"""In bytes; the system takes 4096, and what walks here appends names to it."""


def remove_tree(path: Path) -> None:
    """Remove a folder with all its content, at any depth, as far as that is possible."""
    try:
        shutil.rmtree(path, ignore_errors=True)
    except RecursionError:
        _remove_deep(path)


def listing(folder: Path) -> frozenset[str]:
    """Name, size and time of all files below a folder: what changes when one is damaged.

    To read what is in them would take seconds where there are thousands.
    """
    found = []
    ahead = [str(folder)]
    while ahead:
        # A file that was removed meanwhile is not listed.
        with contextlib.suppress(OSError):
            for entry in os.scandir(ahead.pop()):
                name = entry.path.removeprefix(str(folder))
                if entry.is_dir(follow_symlinks=False):
                    ahead.append(entry.path)
                    found.append(f"{name}/\0\0")
                else:
                    status = entry.stat(follow_symlinks=False)
                    found.append(f"{name}\0{status.st_size}\0{status.st_mtime_ns}")
    return frozenset(found)


def cut_deep(folder: Path) -> bool:
    """Remove what lies too deep in a folder, and let its owner read all else."""
    found = False
    ahead = [(os.fsencode(folder), 0)]
    while ahead:
        path, depth = ahead.pop()
        try:
            _grant(path, os.lstat(path).st_mode)
            entries = [
                (entry.path, entry.stat(follow_symlinks=False).st_mode)
                for entry in os.scandir(path)
            ]
        except OSError:
            continue
        for inside, mode in entries:
            if not stat.S_ISDIR(mode):
                _grant(inside, mode)
            elif depth < MOST_DEEP and len(inside) <= _LONGEST_PATH:
                ahead.append((inside, depth + 1))
            else:
                found = True
                _remove_deep(Path(os.fsdecode(inside)))
    return found


def _grant(path: bytes, mode: int) -> None:
    """Give the owner the permission to read a file or folder, and to remove its content."""
    if stat.S_ISDIR(mode):
        needed = stat.S_IRWXU
    elif stat.S_ISREG(mode):
        needed = stat.S_IRUSR
    else:
        return
    if mode & needed != needed:
        # What belongs to another user stays as it is.
        with contextlib.suppress(OSError):
            os.chmod(path, stat.S_IMODE(mode) | needed)  # noqa: PTH101  bytes


def _remove_deep(path: Path) -> None:
    # They go from folder to folder, with neither recursion nor the whole path.
    for command in (["chmod", "-R", "u+rwX"], ["rm", "-rf"]):
        subprocess.run([*command, "--", path], stderr=subprocess.DEVNULL, check=False)
