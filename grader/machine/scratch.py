"""Scratch folders: gone with the process that made them, or with the next one if it was killed."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import tempfile
import time
from pathlib import Path

from grader.machine.tree import remove_tree

PREFIX = "rosgrade-scratch-"
_ASCII_PLACE = "/tmp"
_STALE_S = 3600.0
"""A newer folder may not be locked yet, or a process started from it may still be ending."""


class Scratch:
    """A scratch folder, below the system's folder for temporary files.

    Its maker holds a lock on it, which the system releases at the latest when the process ends.

    Attributes:
        path: Its absolute path.
    """

    def __init__(self, kind: str) -> None:
        """Make it, and remove what earlier ones left behind."""
        # rosidl's generators cannot build interfaces below a folder with other letters.
        place = tempfile.gettempdir() if tempfile.gettempdir().isascii() else _ASCII_PLACE
        remove_stale(Path(place))
        self._folder = tempfile.TemporaryDirectory(prefix=f"{PREFIX}{kind}-", dir=place)
        self.path = Path(self._folder.name)
        self._lock: int | None = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
        # Some file systems of clusters have no locks, so no other process takes one there either.
        with contextlib.suppress(OSError):
            fcntl.flock(self._lock, fcntl.LOCK_SH)

    def __enter__(self) -> Path:
        """Use it for a block."""
        return self.path

    def __exit__(self, *_: object) -> None:
        """Remove it."""
        self.remove()

    def remove(self) -> None:
        """Remove it with all that is in it, if it is still there."""
        try:
            self._folder.cleanup()
        except RecursionError:
            remove_tree(self.path)
        except OSError as error:
            # After Ctrl-C what still ends may write into it; then the next process removes it.
            if error.errno != errno.ENOTEMPTY:
                raise
        finally:
            if self._lock is not None:
                os.close(self._lock)
                self._lock = None


def remove_stale(folder: Path, age_s: float = _STALE_S) -> None:
    """Remove scratch folders without a lock in which nothing was made for this time."""
    now_s = time.time()
    for path in folder.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):
            if now_s - path.lstat().st_mtime < age_s:
                continue
            lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                remove_tree(path)
            finally:
                os.close(lock)
