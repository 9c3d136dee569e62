"""What the build put into the install space, for ``ros2 run`` and for Python."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from itertools import islice
from pathlib import Path

from grader.machine.ros import site_packages
from grader.recording.submission import Definition
from grader.submission.read.setup_py import EntryPoint, parse_installed

MOST_BYTES = 64 * 1024
"""Largest definition of an interface that is kept."""

_INDEX = Path("share", "ament_index", "resource_index", "packages")
_MAX_METADATA_BYTES = 256 * 1024
_MAX_HASHED_BYTES = 16 * 2**20
_MOST_COPIES = 100
_MOST_SHARED = 1000
_DISTRIBUTION = re.compile(r"(?P<name>.+?)-[^-]+(-py3[.\d]*)?\.(egg-info|dist-info)")


@dataclass(frozen=True)
class InstallSpace:
    """The facts of one install space (merged layout).

    Attributes:
        executables: Package, or another folder in ``lib`` -> what is in ``lib/<package>``.
        in_bin: What is in ``bin``.
        python: Path of each Python file -> hash of its content; relative to site-packages, or
            ``lib/<package>/...`` for scripts.
        origins: Path of each Python file -> the student's file that it was copied from.
        definitions: Package -> the interfaces that it generates.
        shared: Package -> what is in ``share/<package>``, with the student's file of the same
            content, for Python files.
        registered: Packages that are in ament's index of packages, where ROS looks for them.
    """

    executables: Mapping[str, tuple[str, ...]]
    in_bin: tuple[str, ...]
    entry_points: Mapping[str, tuple[EntryPoint, ...]]
    python: Mapping[str, str]
    origins: Mapping[str, str]
    definitions: Mapping[str, tuple[Definition, ...]]
    shared: Mapping[str, tuple[tuple[str, str], ...]]
    registered: frozenset[str]

    def outside(self, package: str) -> tuple[str, ...]:
        """Paths of the executables that are not in the folder of a package."""
        lib = sorted(
            f"lib/{folder}/{name}"
            for folder, names in self.executables.items()
            for name in names
            if folder != package
        )
        return (*(f"bin/{name}" for name in self.in_bin), *lib)


def inspect(install: Path, packages: Iterable[str], sources: Mapping[str, str]) -> InstallSpace:
    """Look at an install space; what is not a regular file there does not count.

    Args:
        sources: Path of each of the student's Python files -> hash of its content.
    """
    executables = _programs_by_folder(install / "lib")
    definitions = {}
    shared = {}
    python: dict[str, str] = {}
    for package in packages:
        scripts = list(regular_files(install / "lib" / package))
        executables[package] = tuple(
            sorted({path.name for path in scripts if os.access(path, os.X_OK)})
        )
        python |= {path.relative_to(install).as_posix(): _hash(path) for path in scripts}
        share = install / "share" / package
        definitions[package] = tuple(_definitions(share))
        shared[package] = _shared(share, sources)
    entry_points = {}
    for site in site_packages(install):
        modules = (path for path in regular_files(site) if path.suffix == ".py")
        python |= {path.relative_to(site).as_posix(): _hash(path) for path in modules}
        for metadata in sorted(site.glob("*-info")):
            match = _DISTRIBUTION.fullmatch(metadata.name)
            if match:
                entry_points[normalised(match["name"])] = _entry_points(metadata)
    return InstallSpace(
        executables,
        tuple(sorted(path.name for path in regular_files(install / "bin"))),
        entry_points,
        python,
        match_files(python, sources),
        definitions,
        shared,
        frozenset(path.name for path in regular_files(install / _INDEX)),
    )


def _programs_by_folder(lib: Path) -> dict[str, tuple[str, ...]]:
    """Folder in ``lib`` -> its programs.

    A wrong setup.cfg names the folder of another package, which need not be there.
    """
    programs: dict[str, tuple[str, ...]] = {}
    for path in sorted(lib.glob("*/*")):
        folder = path.parent
        if not folder.is_symlink() and _is_program(path) and _is_text(folder.name):
            programs[folder.name] = (*programs.get(folder.name, ()), path.name)
    return programs


def _shared(share: Path, sources: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """What is in ``share/<package>``, with the student's file of a Python file."""
    paths = list(islice(regular_files(share), _MOST_SHARED))
    hashes = {str(path): _hash(path) for path in paths if path.suffix == ".py"}
    origins = match_files(hashes, sources)
    return tuple((path.relative_to(share).as_posix(), origins.get(str(path), "")) for path in paths)


def normalised(distribution: str) -> str:
    """Write a distribution's name so that ``bot-publisher`` equals ``bot_publisher``."""
    return re.sub(r"[-_.]+", "_", distribution).lower()


def regular_files(folder: Path) -> Iterator[Path]:
    """All regular files below a folder, without following links, sorted.

    But for those of names that are no text, which no report could hold.
    """
    for parent, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__" and _is_text(name))
        for name in sorted(filter(_is_text, names)):
            path = Path(parent, name)
            if stat.S_ISREG(path.lstat().st_mode):
                yield path


def _is_text(name: str) -> bool:
    """Whether a name as the file system gave it has no undecodable bytes, which are surrogates."""
    return not any("\ud800" <= char <= "\udfff" for char in name)


def match_files(python: Mapping[str, str], sources: Mapping[str, str]) -> dict[str, str]:
    """Installed path -> the student's file of the same content whose path ends most alike.

    Both are given with the hash of each file.
    """
    paths_by_hash: dict[str, list[str]] = {}
    for path, digest in sorted(sources.items()):
        paths_by_hash.setdefault(digest, []).append(path)
    return {
        # Of thousands of copies, any one will do.
        path: max(paths_by_hash[digest][:_MOST_COPIES], key=partial(_common_ending, path))
        for path, digest in python.items()
        if digest in paths_by_hash
    }


def _common_ending(path: str, other: str) -> int:
    """How many parts at the end of two paths are the same."""
    count = 0
    for part, other_part in zip(
        reversed(path.split("/")), reversed(other.split("/")), strict=False
    ):
        if part != other_part:
            break
        count += 1
    return count


def hash_of(data: bytes) -> str:
    """The hash by which installed and handed-in files are compared."""
    return sha256(data).hexdigest()


def _definitions(share: Path) -> Iterator[Definition]:
    """Interfaces with generated code: beside each definition lies its description (REP-2011)."""
    for kind in ("msg", "srv", "action"):
        for path in regular_files(share / kind):
            described = path.with_suffix(".json").is_file()
            if path.suffix == f".{kind}" and described and path.stat().st_size <= MOST_BYTES:
                text = path.read_text(encoding="utf-8", errors="replace")
                yield Definition(path.relative_to(share).as_posix(), text)


def _is_program(path: Path) -> bool:
    return _is_text(path.name) and stat.S_ISREG(path.lstat().st_mode) and os.access(path, os.X_OK)


def _hash(path: Path) -> str:
    if path.stat().st_size > _MAX_HASHED_BYTES:
        return ""
    return hash_of(path.read_bytes())


def _entry_points(metadata: Path) -> tuple[EntryPoint, ...]:
    path = metadata / "entry_points.txt"
    if path not in regular_files(metadata) or path.stat().st_size > _MAX_METADATA_BYTES:
        return ()
    return tuple(parse_installed(path.read_text(encoding="utf-8", errors="replace"), "setup.py"))
