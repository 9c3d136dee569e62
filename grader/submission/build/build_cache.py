"""Builds kept by the content of what was built.

``<cache>/builds/<key>/`` holds ``build.json`` and, where something was installed, ``install/``.
An entry is made under another name and renamed, so it is there as a whole or not at all. The hash
in it finds damage, such as a student's program that wrote into its own installation; what is
damaged is built again.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from grader.errors import GraderFault, machine_fault
from grader.machine.resources import BUILDS, INSTALL, check_executable
from grader.machine.tree import remove_tree
from grader.recording.submission import BuildRecord

_RECORD = "build.json"
_SITE_PACKAGES, _COMPILED = "site-packages", "__pycache__"
_UNFINISHED = ".unfinished-"
_PRUNED = "pruned.stamp"
_PRUNE_EACH_S = 600.0
_LOCK_POLL_S = 0.05
_STALE_S = 24 * 3600.0
_MOST_BYTES = 2 * 2**30
_MOST_AGE_S = 30 * 24 * 3600.0
# A build that was used within this time may be running.
_IN_USE_S = 3600.0


@dataclass(frozen=True)
class _Entry:
    """The content of ``build.json``.

    Attributes:
        seen_with: State of the machine for which the build holds; None for every state, and an
            empty text for none: it is there for who uses it now.
    """

    build: BuildRecord
    installed: bool
    tree: str
    size: int
    seen_with: str | None = None


_ENTRY = TypeAdapter(_Entry)


@dataclass(frozen=True)
class CachedBuild:
    """A build that is in the cache, with its install space if something was installed."""

    build: BuildRecord
    install: Path | None


class BuildCache:
    """The builds in one cache folder; several processes may use it at once.

    A folder that cannot be used is a :class:`GraderFault`.
    """

    def __init__(self, folder: Path, *, is_pruned: bool = True) -> None:
        """Name the folder; it is made when something is stored."""
        self._folder = folder / BUILDS
        self._is_pruned = is_pruned

    @contextlib.contextmanager
    def locked(self, key: str, wait_s: float) -> Iterator[None]:
        """Hold a build's lock, so that two processes do not both build it.

        Args:
            wait_s: Longest wait; without the lock the same work is done twice, nothing worse.
        """
        deadline = time.monotonic() + wait_s
        with _usable(self._folder):
            self._folder.mkdir(parents=True, exist_ok=True)
            check_executable(self._folder)
            file = os.open(self._folder / f"{key}.lock", os.O_RDWR | os.O_CREAT, 0o600)
        try:
            while not _lock(file) and time.monotonic() < deadline:
                time.sleep(_LOCK_POLL_S)
            yield
        finally:
            os.close(file)

    def find(self, key: str, state: Callable[[], str] = str) -> CachedBuild | None:
        """Return a build that is there and whole, or None.

        Args:
            state: Tells the state of the machine, where a build holds only for one.
        """
        folder = self._folder / key
        entry = _read(folder)
        install = folder / INSTALL
        if entry is None or (entry.installed and tree_hash(install) != entry.tree):
            return None
        if entry.seen_with is not None and (not entry.seen_with or entry.seen_with != state()):
            return None
        with contextlib.suppress(OSError):
            os.utime(folder)
        return CachedBuild(replace(entry.build, cached=True), install if entry.installed else None)

    @contextlib.contextmanager
    def unfinished(self) -> Iterator[Path]:
        """A folder in which an entry is made; gone at the end, unless it was stored."""
        with _usable(self._folder):
            self._folder.mkdir(parents=True, exist_ok=True)
            folder = Path(tempfile.mkdtemp(prefix=_UNFINISHED, dir=self._folder))
        try:
            yield folder
        finally:
            remove_tree(folder)

    def store(
        self, key: str, unfinished: Path, build: BuildRecord, seen_with: str | None = None
    ) -> CachedBuild:
        """Make an unfinished folder, with what is in its ``install``, the build of that key.

        An entry that another process stored meanwhile stays and is returned.
        """
        install = unfinished / INSTALL
        installed = install.is_dir()
        size = sum(path.lstat().st_size for path in _files(install))
        entry = _Entry(build, installed, tree_hash(install) if installed else "", size, seen_with)
        with _usable(self._folder):
            (unfinished / _RECORD).write_bytes(_ENTRY.dump_json(entry))
            other = self.find(key, lambda: seen_with or "")
            if other is not None:
                return other
            with contextlib.suppress(FileNotFoundError):
                # One that does not hold, or is damaged; renamed, so that the place is free for the
                # shortest time.
                (self._folder / key).rename(unfinished / "damaged")
            unfinished.rename(self._folder / key)
        shutil.rmtree(self._folder / key / "damaged", ignore_errors=True)
        if self._is_pruned:
            self._prune_sometimes(key)
        return CachedBuild(build, self._folder / key / INSTALL if installed else None)

    def discard(self, key: str) -> None:
        """Forget a build."""
        remove_tree(self._folder / key)

    def _prune_sometimes(self, keep: str) -> None:
        """Look for old builds: in a batch not after every one, as that takes long."""
        marker = self._folder / _PRUNED
        with contextlib.suppress(OSError):
            if not marker.exists() or time.time() - marker.stat().st_mtime >= _PRUNE_EACH_S:
                marker.touch()
                self.prune(keep)

    def prune(self, keep: str = "") -> None:
        """Throw away builds that are old, or the least recently used of too many."""
        now = time.time()
        builds = []
        for folder in self._folder.iterdir():
            try:
                used = folder.lstat().st_mtime
            except OSError:
                continue
            if folder.name.startswith(_UNFINISHED):
                if now - used > _STALE_S:
                    remove_tree(folder)
            elif folder.is_dir() and folder.name != keep and now - used > _IN_USE_S:
                entry = _read(folder)
                builds.append((used, folder, entry.size if entry else 0))
        total = sum(size for _, _, size in builds)
        for used, folder, size in sorted(builds, key=lambda item: item[0]):
            if now - used > _MOST_AGE_S or total > _MOST_BYTES:
                remove_tree(folder)
                (self._folder / f"{folder.name}.lock").unlink(missing_ok=True)
                total -= size


def tree_hash(folder: Path) -> str:
    """Hash all files and links below a folder, with what the build compiled of Python."""
    total = hashlib.sha256()
    for path in _files(folder, compiled=True):
        status, content = path.lstat(), b"special"
        if stat.S_ISLNK(status.st_mode):
            content = os.fsencode(path.readlink())
        elif stat.S_ISREG(status.st_mode):
            content = path.read_bytes()
        executable = b"x" if status.st_mode & stat.S_IXUSR else b"-"
        name = os.fsencode(path.relative_to(folder))
        total.update(executable + name + b"\0" + hashlib.sha256(content).digest())
    return total.hexdigest()


def _files(folder: Path, *, compiled: bool = False) -> Iterator[Path]:
    for parent, folders, names in os.walk(folder):
        links = [name for name in folders if Path(parent, name).is_symlink()]
        # Elsewhere Python compiles while a node runs, without a sandbox.
        kept = compiled and _SITE_PACKAGES in Path(parent).parts
        folders[:] = sorted(name for name in folders if kept or name != _COMPILED)
        for name in sorted([*names, *links]):
            yield Path(parent, name)


def _read(folder: Path) -> _Entry | None:
    try:
        return _ENTRY.validate_json((folder / _RECORD).read_bytes())
    except (OSError, ValidationError):
        return None


def _lock(file: int) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextlib.contextmanager
def _usable(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        unusable = GraderFault(f"the cache folder {folder} cannot be used: {error}")
        raise machine_fault(error, folder) or unusable from error
