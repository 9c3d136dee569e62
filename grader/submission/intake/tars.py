"""The table of contents of an uncompressed tar, as members to be admitted."""

from __future__ import annotations

import re
import tarfile
from collections.abc import Iterator
from typing import IO, cast

from grader.submission.intake.members import Kind, Member, Refused
from grader.submission.intake.paths import shown

_BLOCK = 512
_LONGEST_HEADER = 64 * 1024
# Older tarfile modules search such a run for " hdrcharset=" in quadratic time.
_DIGITS = re.compile(rb"\d{33}")


class _Headers:
    """The file as :mod:`tarfile` sees it: no unbounded reads, since it only reads headers."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        if size > _LONGEST_HEADER:
            raise Refused("a header in it is too long")
        data = self._file.read(size)
        if size > _BLOCK and _DIGITS.search(data):
            raise Refused("a header in it is broken")
        return data

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def close(self) -> None:
        """Leave the file open: it is the caller's."""


def members(file: IO[bytes]) -> Iterator[Member]:
    """List the members; a hard link is listed as one more file with the same data.

    Raises:
        Refused: A member is of a kind that no student's tool makes, or the tar ends in garbage.
        tarfile.TarError: It is no tar, or broken.
    """
    files: dict[str, Member] = {}
    end = 0
    headers = cast("IO[bytes]", _Headers(file))
    with tarfile.open(fileobj=headers, mode="r:", encoding="utf-8") as archive:
        for info in archive:
            end = info.offset_data
            if info.isreg():
                end += -(-info.size // _BLOCK) * _BLOCK
            member = _member(info, files)
            if member.kind is Kind.FILE:
                files[info.name] = member
            yield member
    file.seek(end)
    if file.read(_BLOCK).strip(b"\0"):
        raise tarfile.ReadError(f"garbage after byte {end}")


def _member(info: tarfile.TarInfo, files: dict[str, Member]) -> Member:
    executable = bool(info.mode & 0o111)
    if info.issparse():
        raise Refused(f"{shown(info.name)}: sparse files are refused")
    if info.isreg():
        return Member(info.offset_data, info.name, Kind.FILE, info.size, executable)
    if info.isdir():
        return Member(info.offset_data, info.name, Kind.FOLDER)
    if info.issym():
        return Member(info.offset_data, info.name, Kind.LINK, target=info.linkname)
    if info.islnk():
        first = files.get(info.linkname)
        if first is None:
            raise Refused(
                f"{shown(info.name)}: is a hard link to {shown(info.linkname)}, "
                "which the archive does not hold before it"
            )
        return Member(first.place, info.name, Kind.FILE, first.size, first.executable)
    return Member(info.offset_data, info.name, Kind.SPECIAL)
