"""Which members of an archive may be unpacked, and where: decided before a byte is written.

Everything here is a pure function of names, kinds and sizes.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum

from grader.errors import SubmissionError
from grader.submission.intake.leftovers import built, is_left_out
from grader.submission.intake.paths import parents, shown

MIB = 2**20

LONGEST_TARGET = 1000
_DRIVE = re.compile(r"[A-Za-z]:[/\\]")


@dataclass(frozen=True)
class ArchiveLimits:
    """How much a submission may hold; folders are held to the same sizes and numbers."""

    total_bytes: int = 256 * MIB
    members: int = 20_000
    ratio: int = 200
    ratio_from_bytes: int = 16 * MIB
    depth: int = 40
    path_bytes: int = 1024
    name_bytes: int = 255

    @property
    def members_with_tools(self) -> int:
        """How many members an archive may list, with what tools left behind and is left out."""
        return 10 * self.members


class Kind(Enum):
    """What a member of an archive is."""

    FILE = "file"
    FOLDER = "folder"
    LINK = "symbolic link"
    SPECIAL = "device, pipe or other special file"


@dataclass(frozen=True)
class Member:
    """A member as the archive declares it.

    Attributes:
        place: Where its reader finds it again: index in a zip, offset of the data in a tar.
    """

    place: int
    name: str
    kind: Kind
    size: int = 0
    executable: bool = False
    target: str = ""


class Refused(Exception):
    """Why one member is refused; :func:`admit` adds which one, and of which archive."""


def admit(
    members: Iterable[Member],
    *,
    archive: str,
    archive_bytes: int,
    limits: ArchiveLimits,
    leftovers: set[str] | None = None,
) -> list[Member]:
    """Check every member; nothing may be unpacked when one of them is refused.

    Args:
        leftovers: Gets the paths of what builds and runs made, which is not unpacked.

    Returns:
        What to unpack, with safe relative paths as names. Where links lead is not looked at: see
        :func:`~grader.submission.intake.listing.list_files`.

    Raises:
        SubmissionError: A member is unsafe or too much; names the archive and the member.
    """
    entries: list[Member] = []
    total = 0
    kinds: dict[str, Kind] = {}
    for count, member in enumerate(members, start=1):
        try:
            path = safe_path(member.name, limits)
            is_work = bool(path) and not is_left_out(path)
            if count > limits.members_with_tools or (is_work and len(entries) >= limits.members):
                raise Refused(f"the archive holds more than {limits.members} members")
            if not is_work:
                leftover = built(path)
                if leftovers is not None and leftover is not None:
                    leftovers.add(leftover)
                continue
            if member.kind is Kind.SPECIAL:
                raise Refused("a device, pipe or other special file is refused")
            if member.size < 0:
                raise Refused("its size is negative")
            if member.kind is Kind.LINK and not 0 < len(member.target) <= LONGEST_TARGET:
                raise Refused("the link's target is empty or too long")
            total += member.size
            _check_size(total, archive_bytes, limits)
            _check_place(path, member.kind, kinds)
        except Refused as reason:
            raise SubmissionError(f"{archive}: {shown(member.name)}: {reason}") from None
        kinds[path] = member.kind
        entries.append(replace(member, name=path))
    return entries


def safe_path(name: str, limits: ArchiveLimits) -> str:
    """A member's name as a relative path without ``.`` and ``..``; empty for the archive's root.

    Raises:
        Refused: The name leads out of the folder, or is too long.
    """
    if "\0" in name:
        raise Refused("the name contains a NUL character")
    if name.startswith(("/", "\\")) or _DRIVE.match(name):
        raise Refused("absolute paths are refused")
    parts = [part for part in name.split("/") if part not in ("", ".")]
    if ".." in parts:
        raise Refused("paths with '..' are refused")
    try:
        sizes = [len(os.fsencode(part)) for part in parts]
    except UnicodeEncodeError:
        raise Refused("the name is not valid Unicode") from None
    if len(parts) > limits.depth:
        raise Refused(f"more than {limits.depth} folders deep")
    if max(sizes, default=0) > limits.name_bytes or sum(sizes) + len(sizes) > limits.path_bytes:
        raise Refused("the name is too long")
    return "/".join(parts)


def _check_size(total: int, archive_bytes: int, limits: ArchiveLimits) -> None:
    if total > limits.total_bytes:
        raise Refused(f"with it the archive unpacks to more than {limits.total_bytes // MIB} MiB")
    if total > limits.ratio_from_bytes and total > limits.ratio * archive_bytes:
        raise Refused(f"with it the archive unpacks to more than {limits.ratio} times its size")


def _check_place(path: str, kind: Kind, kinds: dict[str, Kind]) -> None:
    earlier = kinds.get(path)
    is_folder_again = earlier is Kind.FOLDER and kind is Kind.FOLDER
    if earlier is not None and not is_folder_again:
        raise Refused("the archive holds this path twice")
    for folder in parents(path):
        if kinds.setdefault(folder, Kind.FOLDER) is not Kind.FOLDER:
            raise Refused(f"{shown(folder)} is not a folder in this archive")
