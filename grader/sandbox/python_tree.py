"""The Python environment of untrusted code: ROS and the tools of builds, without rosgrade.

rosgrade, its libraries and ROS's wheels share one environment. In a sandbox another one is
mounted in its place, of the same files (hard links, or copies where links are not possible),
that holds only what a machine with ROS and colcon has, and the libraries that the assignment
allows. It is made once and kept in the cache, ``python/<key>/``, until no command has used it for
a month.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Collection, Iterable
from importlib import metadata
from pathlib import Path

from grader.errors import GraderFault
from grader.machine.tree import listing
from grader.spec.nearest_name import did_you_mean

VERSION = 3

# With what `ros2` and launch files need, which a machine with ROS has as well.
_ROOTS = re.compile(
    r"ros-.*|colcon-.*|setuptools|numpy|pyyaml|lark|empy|argcomplete|psutil|packaging|osrf-pycommon"
)
# A name that was given up, and the name that Debian and Ubuntu have: the module is the same.
_RENAMED = {"lark-parser": "lark"}
_NAME = re.compile(r"[A-Za-z0-9._-]+")
_UNFINISHED = ".unfinished-"
_UNUSED_S = 30 * 24 * 3600.0
_FOR_OTHERS = 0o444


def trees_folder(cache: Path) -> Path:
    """Where all environments are; made if it is not there."""
    folder = cache / "python"
    folder.mkdir(parents=True, exist_ok=True)
    # A sandbox runs as another user, where rosgrade runs as root.
    if folder.stat().st_mode & 0o555 != 0o555:
        folder.chmod(0o755)
    return folder


def student_prefix(cache: Path, libraries: Collection[str] = ()) -> Path:
    """The environment, made if it is not there."""
    check_installed(libraries)
    prefix, wanted = Path(sys.prefix), frozenset(map(_normal, libraries))
    parts = [str(VERSION), str(prefix), sys.executable, sys.version, *sorted(wanted)]
    # Their folders are named by distribution and version; to read them all takes 0.1 s.
    parts += sorted(path.name for path in prefix.glob("lib/python3*/site-packages/*-info"))
    key = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]
    tree = trees_folder(cache) / key
    if tree.is_dir() and not is_whole(tree):
        discard(tree)
    if not tree.is_dir():
        _make(tree, prefix, _closure(wanted).values())
        prune(tree.parent)
    with contextlib.suppress(OSError):
        for used in (tree, _list_file(tree)):
            os.utime(used)
    return tree


def is_whole(tree: Path) -> bool:
    """Whether all of it is still there as it was made: caches are emptied, disks damaged."""
    try:
        return _list_file(tree).read_text(encoding="ascii") == _listed(tree)
    except (OSError, ValueError):
        return False


def discard(tree: Path) -> None:
    """Let another one be made in its place; what uses it keeps what is left."""
    with contextlib.suppress(OSError):
        tree.rename(tempfile.mkdtemp(prefix=_UNFINISHED, dir=tree.parent))


def check_installed(libraries: Collection[str]) -> None:
    """See that what an assignment allows is there to be imported."""
    for lack in not_installed(libraries):
        raise GraderFault(lack)


def not_installed(libraries: Collection[str], who: str = "the assignment allows") -> list[str]:
    """Say of each library that is not there what it is, and how it gets there."""
    installed = set(_installed()) if libraries else set()
    problems = []
    for name in libraries:
        if installed.isdisjoint((_normal(name), _RENAMED.get(_normal(name)))):
            near = did_you_mean(name, installed)
            problems.append(
                f"{who} the library {name!r}, which is not installed here.{near} "
                f"{'Otherwise install it' if near else 'To install it'}: "
                f"{sys.executable} -m pip install {name}"
            )
    return problems


def unlisted(
    modules: Collection[str], libraries: Collection[str], within: Path = Path("/")
) -> tuple[str, ...]:
    """Find modules that can be imported here, but not in the environment of a sandbox.

    Args:
        within: Only what lies in this folder.
    """
    foreign = set(modules) - sys.stdlib_module_names - {"numpy"}
    if not foreign:
        return ()
    installed, allowed = _installed(), _closure({_normal(name) for name in libraries})
    not_allowed = []
    for module, names in metadata.packages_distributions().items():
        owners = {_normal(name) for name in names}
        is_there = any(_is_in(installed[owner], within) for owner in owners)
        if module in foreign and allowed.keys().isdisjoint(owners) and is_there:
            not_allowed.append(module)
    return tuple(sorted(not_allowed))


def prune(folder: Path) -> None:
    """Throw away what has not been used for a month."""
    for path in folder.iterdir():
        with contextlib.suppress(OSError):
            if time.time() - path.lstat().st_mtime < _UNUSED_S:
                continue
            if path.is_dir():
                # Renamed first: a part of it is never found.
                shutil.rmtree(path.rename(path.with_name(f"{_UNFINISHED}{path.name}")))
            else:
                path.unlink()


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _installed() -> dict[str, metadata.Distribution]:
    return {_normal(item.metadata["Name"]): item for item in metadata.distributions()}


def _is_in(distribution: metadata.Distribution, folder: Path) -> bool:
    return Path(str(distribution.locate_file(""))).is_relative_to(folder)


def _closure(libraries: Collection[str]) -> dict[str, metadata.Distribution]:
    """ROS, what an assignment allows beside it, and all that they require."""
    installed = _installed()
    pending = [name for name in installed if _ROOTS.fullmatch(name) or name in libraries]
    required: dict[str, metadata.Distribution] = {}
    while pending:
        name = pending.pop()
        if name in required or name not in installed:
            continue
        required[name] = installed[name]
        for requirement in required[name].requires or ():
            match = _NAME.match(requirement)
            if match and "extra ==" not in requirement:
                pending.append(_normal(match.group()))
    return required


def _make(target: Path, prefix: Path, distributions: Iterable[metadata.Distribution]) -> None:
    unfinished = Path(tempfile.mkdtemp(prefix=_UNFINISHED, dir=target.parent))
    files = {Path("pyvenv.cfg"), Path("lib64")}
    files |= {path.relative_to(prefix) for path in prefix.glob("bin/python*")}
    for distribution in distributions:
        for file in distribution.files or ():
            path = Path(os.path.normpath(str(distribution.locate_file(file))))
            if path.is_relative_to(prefix):
                files.add(path.relative_to(prefix))
    try:
        for name in sorted(files):
            _link(prefix / name, unfinished / name)
        for folder, _, _ in os.walk(unfinished):
            Path(folder).chmod(0o755)
        with tempfile.NamedTemporaryFile("w", dir=target.parent, delete=False) as list_file:
            list_file.write(_listed(unfinished))
        Path(list_file.name).replace(_list_file(target))
        # Another process was quicker, perhaps.
        with contextlib.suppress(OSError):
            unfinished.rename(target)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _list_file(tree: Path) -> Path:
    return tree.with_name(f"{tree.name}.files")


def _listed(tree: Path) -> str:
    text = "\n".join(sorted(listing(tree)))
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


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
