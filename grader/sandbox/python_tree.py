"""The Python environment of untrusted code: ROS and what builds packages, nothing of ours.

rosgrade, its libraries and ROS's wheels share one environment. In a sandbox another one is
mounted in its place, of the same files (hard links, or copies where links are not possible),
that holds only what a machine with ROS and colcon has, and the libraries that the assignment
allows. It is made once and kept in the cache, ``python/<key>/``. Whoever uses one holds a shared
lock on ``<key>.lock``; what nobody uses is thrown away when it is old, or one of too many.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from grader.errors import GraderFault
from grader.spec.nearest_name import did_you_mean
from grader.tree import listing

VERSION = 2
KEPT = 4
"""Trees that nobody uses at the moment; each holds up to 0.3 GB where ROS was updated since."""
AGE_S = 30 * 24 * 3600.0
"""A tree goes when it was not used for so long."""

_ROOTS = re.compile(r"ros-.*|colcon-.*|setuptools|numpy|pyyaml|lark|empy")
_NAME = re.compile(r"[A-Za-z0-9._-]+")
_LOCK = ".lock"
_UNFINISHED = ".unfinished-"
_STALE_S = 3600.0
_READABLE = 0o555
_FOR_OTHERS = 0o444


@dataclass(frozen=True)
class PythonTree:
    """An environment that is held: it stays as long as this object, or its process."""

    path: Path
    lock: int

    def is_whole(self) -> bool:
        """Whether all of it is still there as it was made: caches are emptied, disks damaged."""
        try:
            return _list_file(self.path).read_text(encoding="ascii") == _listed(self.path)
        except (OSError, ValueError):
            return False

    def discard(self) -> None:
        """Let another one be made in its place; what uses it keeps what is left."""
        with contextlib.suppress(OSError):
            gone = tempfile.mkdtemp(prefix=_UNFINISHED, dir=self.path.parent)
            self.path.rename(gone)

    def __del__(self) -> None:
        """Let it go."""
        os.close(self.lock)


def trees_folder(cache: Path) -> Path:
    """Where all environments are; made if it is not there."""
    folder = cache / "python"
    folder.mkdir(parents=True, exist_ok=True)
    # Whoever runs in a sandbox is another user, where rosgrade runs as root.
    if folder.stat().st_mode & _READABLE != _READABLE:
        folder.chmod(0o755)
    return folder


def student_prefix(
    cache: Path, libraries: Collection[str] = (), prefix: Path = Path(sys.prefix)
) -> PythonTree:
    """The environment, made if it is not there.

    Raises:
        GraderFault: A library is not installed here.
    """
    check_installed(libraries)
    wanted = frozenset(map(_normal, libraries))
    parts = [str(VERSION), str(prefix), sys.executable, sys.version, *sorted(wanted)]
    # Their folders are named by distribution and version; to read them all takes 0.1 s.
    parts += sorted(path.name for path in prefix.glob("lib/python3*/site-packages/*-info"))
    key = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]
    target = trees_folder(cache) / key
    tree = PythonTree(target, _hold(target))
    if target.is_dir() and not tree.is_whole():
        tree.discard()
    if not target.is_dir():
        _make(target, prefix, _closure(wanted).values())
        prune(target.parent)
    with contextlib.suppress(OSError):
        os.utime(target)
    return tree


def check_installed(libraries: Collection[str]) -> None:
    """See that what an assignment allows is there to be imported.

    Raises:
        GraderFault: It is not.
    """
    for lack in not_installed(libraries):
        raise GraderFault(lack)


def not_installed(libraries: Collection[str]) -> list[str]:
    """Say of each library that is not there what it is, and how it gets there."""
    if not libraries:
        return []
    installed = set(_installed())
    return [_lack(name, installed) for name in libraries if _normal(name) not in installed]


def _lack(name: str, installed: Collection[str]) -> str:
    near = did_you_mean(name, installed)
    return (
        f"the assignment allows the library {name!r}, which is not installed here.{near} "
        f"{'Otherwise install it' if near else 'To install it'}: "
        f"{sys.executable} -m pip install {name}"
    )


def unlisted(modules: Collection[str], libraries: Collection[str]) -> tuple[str, ...]:
    """Find modules that can be imported here, but not in the environment of a sandbox."""
    foreign = set(modules) - sys.stdlib_module_names - {"numpy"}
    if not foreign:
        return ()
    allowed = _closure({_normal(name) for name in libraries})
    owners = metadata.packages_distributions()
    return tuple(
        module
        for module in sorted(foreign & owners.keys())
        if not any(_normal(owner) in allowed for owner in owners[module])
    )


def prune(folder: Path, kept: int = KEPT, age_s: float = AGE_S) -> None:
    """Throw away environments that nobody uses."""
    now_s = time.time()
    trees: list[tuple[float, Path]] = []
    for path in folder.iterdir():
        with contextlib.suppress(OSError):
            used_s = path.lstat().st_mtime
            if path.name.startswith(_UNFINISHED):
                if now_s - used_s > _STALE_S:
                    shutil.rmtree(path, ignore_errors=True)
            elif path.is_dir():
                trees.append((used_s, path))
    for number, (used_s, path) in enumerate(sorted(trees, reverse=True)):
        if number >= kept or now_s - used_s > age_s:
            with _unused(path) as unused:
                if unused:
                    # Renamed first: nobody finds a part of it.
                    gone = path.with_name(f"{_UNFINISHED}{path.name}")
                    with contextlib.suppress(OSError):
                        path.rename(gone)
                        _list_file(path).unlink(missing_ok=True)
                    shutil.rmtree(gone, ignore_errors=True)


def _hold(target: Path) -> int:
    lock = os.open(target.with_name(target.name + _LOCK), os.O_RDWR | os.O_CREAT, 0o600)
    # Waits only while somebody throws it away.
    fcntl.flock(lock, fcntl.LOCK_SH)
    return lock


@contextlib.contextmanager
def _unused(path: Path) -> Iterator[bool]:
    """Whether nobody holds an environment; nobody gets it meanwhile."""
    # The file stays: who waits for its lock would else hold one that nobody looks at any more.
    lock = os.open(path.with_name(path.name + _LOCK), os.O_RDWR | os.O_CREAT, 0o600)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True
    finally:
        os.close(lock)


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _installed() -> dict[str, metadata.Distribution]:
    return {_normal(item.metadata["Name"]): item for item in metadata.distributions()}


def _closure(libraries: Collection[str]) -> dict[str, metadata.Distribution]:
    """Installed distributions by name: the roots, and all that they need."""
    installed = _installed()
    queue = [name for name in installed if _ROOTS.fullmatch(name) or name in libraries]
    found: dict[str, metadata.Distribution] = {}
    while queue:
        name = queue.pop()
        if name in found or name not in installed:
            continue
        found[name] = installed[name]
        for requirement in found[name].requires or ():
            match = _NAME.match(requirement)
            if match and "extra ==" not in requirement:
                queue.append(_normal(match.group()))
    return found


def _make(target: Path, prefix: Path, distributions: Iterable[metadata.Distribution]) -> None:
    unfinished = Path(tempfile.mkdtemp(prefix=_UNFINISHED, dir=target.parent))
    try:
        for file in sorted(_contents(prefix, distributions)):
            _link(prefix / file, unfinished / file)
        for folder, _, _ in os.walk(unfinished):
            Path(folder).chmod(0o755)
        with tempfile.NamedTemporaryFile("w", dir=target.parent, delete=False) as list_file:
            list_file.write(_listed(unfinished))
        Path(list_file.name).replace(_list_file(target))
        # Somebody else was quicker, perhaps.
        with contextlib.suppress(OSError):
            unfinished.rename(target)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _list_file(tree: Path) -> Path:
    """The file beside an environment that says what is in it."""
    return tree.with_name(f"{tree.name}.files")


def _listed(tree: Path) -> str:
    text = "\n".join(sorted(listing(tree)))
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def _contents(prefix: Path, distributions: Iterable[metadata.Distribution]) -> set[Path]:
    """What is in an environment with these distributions, relative to it."""
    files = {file for item in distributions for file in _files(item, prefix)}
    files |= {Path("pyvenv.cfg"), Path("lib64")}
    return files | {path.relative_to(prefix) for path in prefix.glob("bin/python*")}


def _files(distribution: metadata.Distribution, prefix: Path) -> Iterable[Path]:
    """What a distribution has installed in the environment, relative to it."""
    for file in distribution.files or ():
        path = Path(os.path.normpath(str(distribution.locate_file(file))))
        if path.is_relative_to(prefix):
            yield path.relative_to(prefix)


def _link(source: Path, target: Path) -> None:
    if not (source.is_symlink() or source.is_file()):
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    mode = source.lstat().st_mode
    if mode & _FOR_OTHERS != _FOR_OTHERS:
        # Installed with a umask such as 077.
        shutil.copy2(source, target)
        target.chmod(mode | _FOR_OTHERS | (mode & 0o100) >> 2 | (mode & 0o100) >> 5)
        return
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        shutil.copy2(source, target, follow_symlinks=False)
