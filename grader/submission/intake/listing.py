"""Which files of a folder are the submission.

What colcon, Python, git and editors left behind is not: a student often hands in the whole
workspace, with copies of every package in ``build/`` and ``install/``.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from grader.errors import GraderFault, SubmissionError, machine_fault
from grader.submission.intake.leftovers import (
    COLCON_FOLDERS,
    MARKS,
    built,
    is_left_out,
    is_leftover,
)
from grader.submission.intake.members import MIB, ArchiveLimits
from grader.submission.intake.paths import is_within, join, parents, shown
from grader.submission.read.manifest import MANIFEST

_SOURCE_SPACE = "src"
_IGNORE_MARKERS = ("COLCON_IGNORE", "AMENT_IGNORE", "CATKIN_IGNORE")
_MOST_HOPS = 40
_CHANGED = frozenset({errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.ESTALE})


@dataclass(frozen=True)
class SubmissionFile:
    """A file of the submission; its path is relative, with undecodable bytes as surrogates.

    Attributes:
        link: Where a symbolic link leads, relative to the link's folder; None for a file.
    """

    path: str
    size: int
    executable: bool = False
    link: str | None = None


def inside(files: Iterable[SubmissionFile], folder: str) -> list[SubmissionFile]:
    """The files of a folder as seen from it; ``.`` is the whole submission."""
    start = 0 if folder == "." else len(folder) + 1
    return [replace(file, path=file.path[start:]) for file in files if is_within(file.path, folder)]


class ChangedMeanwhile(GraderFault):
    """The submission is written to while it is read: by an editor, `git`, a synced folder."""

    def __init__(self, path: str) -> None:
        """Name the file."""
        super().__init__(f"{shown(path)}: changed while the submission was read; grade it again")


def unreadable(path: str, error: OSError) -> SubmissionError | GraderFault:
    """Whose fault it is that a file cannot be read."""
    if error.errno in _CHANGED:
        return ChangedMeanwhile(path)
    cannot_be_read = SubmissionError(f"{shown(path)}: cannot be read: {error.strerror}")
    return machine_fault(error, Path(path)) or cannot_be_read


def list_files(
    root: Path, limits: ArchiveLimits | None = None, leftovers: set[str] | None = None
) -> list[SubmissionFile]:
    """List a folder, the same way on every machine.

    Args:
        leftovers: Gets the paths of what builds and runs made, which is not listed.

    Raises:
        SubmissionError: Too many or too large files, a file that cannot be read, or a symbolic
            link that leads out of the folder.
    """
    limits = limits or ArchiveLimits()
    files: list[SubmissionFile] = []
    links: dict[str, str] = {}
    total = 0
    try:
        for path, entry in _walk(root, ".", False, limits.depth):
            if entry is None:
                leftover = built(path)
                if leftovers is not None and leftover is not None:
                    leftovers.add(leftover)
            elif entry.is_symlink():
                links[path] = _end(root, path)
            elif entry.is_file(follow_symlinks=False):
                status = entry.stat(follow_symlinks=False)
                total += status.st_size
                executable = bool(status.st_mode & stat.S_IXUSR)
                files.append(SubmissionFile(path, status.st_size, executable))
            if len(files) + len(links) > limits.members:
                raise SubmissionError(f"the submission holds more than {limits.members} files")
            if total > limits.total_bytes:
                largest = max(files, key=lambda file: file.size)
                raise SubmissionError(
                    f"the submission holds more than {limits.total_bytes // MIB} MiB (largest file "
                    f"so far: {shown(largest.path)}, {largest.size / MIB:.1f} MiB)"
                )
    except OSError as error:
        raise unreadable(str(error.filename), error) from error
    paths = {path for file in files for path in (file.path, *parents(file.path))}
    for path in links:
        end = path
        for _ in range(_MOST_HOPS):
            end = links.get(end, end)
        if end in paths:
            link = os.path.relpath(end, path.rpartition("/")[0] or ".")
            files.append(SubmissionFile(path, 0, link=link))
    return sorted(files, key=lambda file: os.fsencode(file.path))


def _walk(
    root: Path, folder: str, in_package: bool, depth: int
) -> Iterator[tuple[str, os.DirEntry[str] | None]]:
    """Paths with their entries; what a tool left behind has none."""
    with os.scandir(root / folder) as unsorted:
        entries = sorted(unsorted, key=lambda entry: entry.name)
    if depth < 0:
        raise SubmissionError(f"{shown(folder)}: folders are nested too deep")
    in_package = in_package or any(entry.name == MANIFEST for entry in entries)
    for entry in entries:
        path = join(folder, entry.name)
        if not entry.is_dir(follow_symlinks=False):
            is_linked_leftover = entry.is_symlink() and entry.name in COLCON_FOLDERS
            if is_left_out(entry.name) or entry.name.endswith(".pyc") or is_linked_leftover:
                yield path, None
            else:
                yield path, entry
            continue
        marks = {mark for mark in MARKS if os.path.lexists(root / path / mark)}
        if is_leftover(entry.name, marks, in_package):
            yield path, None
        else:
            yield from _walk(root, path, in_package, depth - 1)


def _end(root: Path, path: str) -> str:
    """Where a symbolic link leads, as a path in the folder; others on the way are not followed."""
    target = os.fspath((root / path).readlink())
    ends = [os.path.normpath(join(path, f"../{target}"))]
    if target.startswith("/"):
        # An absolute link into the folder itself is as good as a relative one.
        ends = [os.path.relpath(target, base) for base in (root.absolute(), root.resolve())]
    for end in ends:
        if end.split("/")[0] != "..":
            return end
    raise SubmissionError(
        f"{shown(path)}: the link to {shown(target)!r} leads out of the submission; put a copy "
        "of its target there instead"
    )


def wrapper_of(files: Sequence[SubmissionFile]) -> str:
    """The folders around the packages that hold nothing else: ``ana_hw1`` in ``ana_hw1/src/...``.

    Each student packs the same work under another name.

    Returns:
        The deepest one that is not ``src``; ``.`` where there is none, or where links may need it.
    """
    packages = find_packages(file.path for file in files)
    wrapper = "."
    if not packages or any(file.link for file in files):
        return wrapper
    for folder in reversed(parents(packages[0])):
        if folder.rpartition("/")[2] == _SOURCE_SPACE:
            break
        if not all(file.path.startswith(f"{folder}/") for file in files):
            break
        wrapper = folder
    return wrapper


def find_packages(paths: Iterable[str]) -> list[str]:
    """Find the package folders, as colcon would: sorted, and none inside of another."""
    folders, ignored = set(), set()
    for path in paths:
        folder, _, name = path.rpartition("/")
        if name == MANIFEST:
            folders.add(folder or ".")
        elif name in _IGNORE_MARKERS:
            ignored.add(folder or ".")
    packages: set[str] = set()
    outer_first = sorted(folders, key=lambda folder: (folder != ".", folder.count("/")))
    for folder in outer_first:
        above = {folder, *parents(folder), "."}
        hidden = any(part.startswith(".") and part != "." for part in folder.split("/"))
        if not hidden and ignored.isdisjoint(above) and packages.isdisjoint(above):
            packages.add(folder)
    return sorted(packages, key=os.fsencode)
