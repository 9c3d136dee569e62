"""The Python environment of untrusted code: ROS and what builds packages, nothing of ours.

rosgrade, its libraries and ROS's wheels share one environment. In a sandbox another one is
mounted in its place, of the same files (hard links, or copies where links are not possible),
that holds only what a machine with ROS and colcon has. It is made once and kept in the cache.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Collection, Iterable
from importlib import metadata
from pathlib import Path

VERSION = 1
_ROOTS = re.compile(r"ros-.*|colcon-.*|setuptools|numpy|pyyaml|lark|empy")
_NAME = re.compile(r"[A-Za-z0-9._-]+")


def student_prefix(
    cache: Path, libraries: Collection[str] = (), prefix: Path = Path(sys.prefix)
) -> Path:
    """The environment's folder, made if it is not there.

    Args:
        cache: rosgrade's cache folder.
        libraries: Distributions that the assignment allows besides.
        prefix: The environment that rosgrade runs in.
    """
    parts = [str(VERSION), str(prefix), sys.executable, sys.version, *sorted(libraries)]
    # Their folders are named by distribution and version; to read them all takes 0.1 s.
    parts += sorted(path.name for path in prefix.glob("lib/python3*/site-packages/*-info"))
    key = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]
    target = cache / "python" / key
    if not target.is_dir():
        target.parent.mkdir(parents=True, exist_ok=True)
        _make(target, prefix, _closure(set(map(_normal, libraries))).values())
    return target


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _closure(libraries: Collection[str]) -> dict[str, metadata.Distribution]:
    """Installed distributions by name: the roots, and all that they need."""
    installed = {_normal(item.metadata["Name"]): item for item in metadata.distributions()}
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
    unfinished = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=target.parent))
    try:
        unfinished.chmod(0o755)
        files = {file for item in distributions for file in _files(item, prefix)}
        files |= {Path("pyvenv.cfg"), Path("lib64")}
        files |= {path.relative_to(prefix) for path in prefix.glob("bin/python*")}
        for file in sorted(files):
            _link(prefix / file, unfinished / file)
        # Somebody else was quicker, perhaps.
        with contextlib.suppress(OSError):
            unfinished.rename(target)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


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
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        shutil.copy2(source, target, follow_symlinks=False)
