"""Makes an install space safe to open, follow and move, or refuses it."""

from __future__ import annotations

import os
import shutil
import stat
from pathlib import Path


def tidy(install: Path, sources: Path, *, most_bytes: int, most_files: int) -> str | None:
    """See that an install space holds nothing that is dangerous to open or follow.

    Symbolic links to the submission's files, or to nothing, are removed: they will lead nowhere.
    The others are made relative, as the install space will be moved.

    Returns:
        Why it cannot be used at all, in which case it is removed, or None.
    """
    if install.is_symlink():
        install.unlink()
        return "the build put a symbolic link in place of the install space"
    total_bytes = count = 0
    refused: list[str] = []
    places = os.path.realpath(install), os.path.realpath(sources)
    for parent, folders, names in os.walk(install):
        for name in [*folders, *names]:
            path = Path(parent, name)
            status = path.lstat()
            total_bytes += status.st_size
            count += 1
            if stat.S_ISLNK(status.st_mode):
                target = _tidy_link(path, *places)
                if target is not None:
                    refused.append(f"{_quoted(path, install)}, a link out to {target!r}")
            elif not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
                refused.append(f"{_quoted(path, install)}, which is not a file, folder or link")
                path.unlink()
    if total_bytes > most_bytes or count > most_files:
        shutil.rmtree(install)
        return f"the build installed more than {most_files} files or {most_bytes} bytes"
    if refused:
        shutil.rmtree(install)
        return f"the build installed {min(refused)}"
    return None


def _tidy_link(link: Path, install: str, sources: str) -> str | None:
    """Remove a link, or make it relative; its target if that is neither installed nor handed in."""
    end = os.path.realpath(link)
    exists = _exists(end)
    if _is_below(end, install):
        is_absolute = link.readlink().is_absolute()
        if not exists or is_absolute:
            link.unlink()
        if exists and is_absolute:
            link.symlink_to(os.path.relpath(end, os.path.realpath(link.parent)))
        return None
    target = str(link.readlink())
    link.unlink()
    return target if exists and not _is_below(end, sources) else None


def _is_below(path: str, folder: str) -> bool:
    return f"{path}/".startswith(f"{folder}/")


def _exists(path: str) -> bool:
    """Whether a path leads to something; it may be one that no file system can have."""
    try:
        return Path(path).exists()
    except OSError:
        return False


def _quoted(path: Path, install: Path) -> str:
    """A path in quotes, since the student chose the name."""
    return repr(str(path.relative_to(install)))
