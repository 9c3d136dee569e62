"""Which files of a folder are the submission.

What colcon, Python, git and editors left behind is not: a student often hands in the whole
workspace, with copies of every package in ``build/`` and ``install/``.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from grader.errors import GraderFault, SubmissionError
from grader.submission.intake.leftovers import COLCON_FOLDERS, is_left_out, is_leftover
from grader.submission.intake.members import (
    MIB,
    ArchiveLimits,
    LeadsOut,
    resolve_link,
)
from grader.submission.intake.paths import is_within, join, parents, shown
from grader.submission.read.manifest import MANIFEST

SOURCE_SPACE = "src"
"""Where a colcon workspace has its packages."""
IGNORE_MARKERS = ("COLCON_IGNORE", "AMENT_IGNORE", "CATKIN_IGNORE")
_CHANGED = frozenset({errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.ESTALE})
_OF_THE_MACHINE = frozenset(
    {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EMFILE, errno.ENFILE, errno.EIO, errno.ENOMEM}
)


@dataclass(frozen=True)
class SubmissionFile:
    """A file of the submission.

    Attributes:
        path: Relative, forward slashes, undecodable bytes as surrogates.
        size: In bytes; 0 for a link.
        link: Where a symbolic link leads, relative to the link's folder; None for a file.
    """

    path: str
    size: int
    executable: bool = False
    link: str | None = None


@dataclass
class Listing:
    """What was found in a folder."""

    files: list[SubmissionFile] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)

    def inside(self, folder: str) -> Listing:
        """The same seen from a folder that holds all files; ``.`` is the whole submission."""
        if folder == ".":
            return self
        start = len(folder) + 1
        return Listing(
            [replace(file, path=file.path[start:]) for file in self.files],
            sorted(path[start:] if is_within(path, folder) else path for path in self.skipped),
        )


class ChangedMeanwhile(GraderFault):
    """Somebody writes to the submission while it is read: an editor, `git`, a synced folder."""

    def __init__(self, path: str) -> None:
        """Name the file."""
        super().__init__(
            f"{shown(path)}: changed while the submission was read; grade again when nobody "
            "writes to it"
        )


def unreadable(path: str, error: OSError) -> SubmissionError | GraderFault:
    """Whose fault it is that a file cannot be read."""
    if error.errno in _CHANGED:
        return ChangedMeanwhile(path)
    if error.errno in _OF_THE_MACHINE:
        return GraderFault(f"no private copy of the submission could be made: {error}")
    return SubmissionError(f"{shown(path)}: cannot be read: {error.strerror}")


def list_files(root: Path, limits: ArchiveLimits | None = None) -> Listing:
    """List a folder, the same way on every machine.

    Raises:
        SubmissionError: Too many or too large files, a file that cannot be read, or a symbolic
            link that leads out of the folder.
        GraderFault: This machine cannot read it now.
    """
    try:
        return _list_files(root, limits or ArchiveLimits())
    except OSError as error:
        raise unreadable(str(error.filename), error) from error


def _list_files(root: Path, limits: ArchiveLimits) -> Listing:
    listing = Listing()
    links: dict[str, str] = {}
    total = 0
    for path, entry in _walk(root, ".", False, listing.skipped, limits.depth):
        if entry.is_symlink():
            links[path] = _target(root, path)
        elif entry.is_file(follow_symlinks=False):
            status = entry.stat(follow_symlinks=False)
            total += status.st_size
            executable = bool(status.st_mode & stat.S_IXUSR)
            listing.files.append(SubmissionFile(path, status.st_size, executable))
        if len(listing.files) + len(links) > limits.members:
            raise SubmissionError(f"the submission holds more than {limits.members} files")
        if total > limits.total_bytes:
            raise SubmissionError(_too_large(listing.files, limits))
    listing.files += _links_inside(links, listing.files)
    listing.files.sort(key=lambda file: os.fsencode(file.path))
    listing.skipped.sort()
    return listing


def _walk(
    root: Path, folder: str, in_package: bool, skipped: list[str], depth: int
) -> Iterator[tuple[str, os.DirEntry[str]]]:
    with os.scandir(root / folder) as found:
        entries = sorted(found, key=lambda entry: entry.name)
    if depth < 0:
        raise SubmissionError(f"{shown(folder)}: too many folders in one another")
    in_package = in_package or any(entry.name == MANIFEST for entry in entries)
    for entry in entries:
        path = join(folder, entry.name)
        if not entry.is_dir(follow_symlinks=False):
            linked_leftover = entry.is_symlink() and entry.name in COLCON_FOLDERS
            if not (is_left_out(entry.name) or entry.name.endswith(".pyc") or linked_leftover):
                yield path, entry
        elif is_leftover(entry.name, partial(_holds, root / path), in_package):
            skipped.append(path)
        else:
            yield from _walk(root, path, in_package, skipped, depth - 1)


def _holds(folder: Path, name: str) -> bool:
    return (folder / name).exists()


def _target(root: Path, path: str) -> str:
    target = os.fspath((root / path).readlink())
    if not target.startswith("/"):
        return target
    # An absolute link into the folder itself is as good as a relative one.
    for base in (root.absolute(), root.resolve()):
        inside = os.path.relpath(target, base)
        if inside.split("/")[0] != "..":
            return os.path.relpath(inside, path.rpartition("/")[0] or ".")
    raise SubmissionError(_leads_out(path, target))


def _links_inside(links: dict[str, str], files: list[SubmissionFile]) -> list[SubmissionFile]:
    if not links:
        return []
    present = {file.path for file in files}
    present.update(folder for path in list(present) for folder in parents(path))
    kept = []
    for path, target in links.items():
        try:
            end = resolve_link(path, links)
        except LeadsOut:
            raise SubmissionError(_leads_out(path, target)) from None
        if end in present:
            kept.append(SubmissionFile(path, 0, link=target))
    return kept


def _leads_out(path: str, target: str) -> str:
    return (
        f"{shown(path)}: the link to {shown(target)!r} leads out of the submission; "
        "put what it leads to there instead"
    )


def _too_large(files: list[SubmissionFile], limits: ArchiveLimits) -> str:
    largest = max(files, key=lambda file: file.size)
    return (
        f"the submission holds more than {limits.total_bytes // MIB} MiB "
        f"(largest file so far: {shown(largest.path)}, {largest.size / MIB:.1f} MiB)"
    )


def wrapper_of(files: Iterable[SubmissionFile]) -> str:
    """The folders around the packages that hold nothing else: ``ana_hw1`` in ``ana_hw1/src/...``.

    The same work is packed under another name by everybody who hands it in.

    Returns:
        The deepest one. ``src`` and what is in it belong to the submission; ``.`` where there is
        no such folder, or no package, or where a link needs it.
    """
    files = tuple(files)
    packages = find_packages(file.path for file in files)
    if not packages:
        return "."
    wrapper = "."
    for folder in reversed(parents(packages[0])):
        if folder.rpartition("/")[2] == SOURCE_SPACE:
            break
        if not all(file.path.startswith(f"{folder}/") for file in files):
            break
        wrapper = folder
    start = 0 if wrapper == "." else len(wrapper) + 1
    links = {file.path[start:]: file.link for file in files if file.link is not None}
    try:
        for path in links:
            resolve_link(path, links)
    except LeadsOut:
        return "."
    return wrapper


def find_packages(paths: Iterable[str]) -> list[str]:
    """Find the package folders, as colcon would.

    Returns:
        Folders with a ``package.xml``, sorted, without those inside another package, in hidden
        folders, or below a ``COLCON_IGNORE``, ``AMENT_IGNORE`` or ``CATKIN_IGNORE``.
    """
    folders, ignored = set(), set()
    for path in paths:
        folder, _, name = path.rpartition("/")
        if name == MANIFEST:
            folders.add(folder or ".")
        elif name in IGNORE_MARKERS:
            ignored.add(folder or ".")
    found: list[str] = []
    for folder in sorted(folders, key=lambda folder: (folder != ".", folder.count("/"))):
        above = {folder, *parents(folder), "."}
        hidden = any(part.startswith(".") and part != "." for part in folder.split("/"))
        if not hidden and ignored.isdisjoint(above) and set(found).isdisjoint(above):
            found.append(folder)
    return sorted(found, key=os.fsencode)
