"""The table of contents of a zip or an uncompressed tar, as members to be admitted."""

from __future__ import annotations

import re
import stat
import tarfile
import zipfile
from collections.abc import Iterator
from typing import IO, cast

from grader.submission.intake.members import (
    LONGEST_TARGET,
    MIB,
    ArchiveLimits,
    Kind,
    Member,
    Refused,
)
from grader.submission.intake.paths import shown

_MADE_BY_DOS, _MADE_BY_UNIX = 0, 3
_FLAG_ENCRYPTED, _FLAG_UTF8 = 0x1, 0x800
_DIRECTORY_ENTRY = b"PK\x01\x02"
_BLOCK = 512
_LONGEST_HEADER = 64 * 1024
# Older tarfile modules search such a run for " hdrcharset=" in quadratic time.
_DIGITS = re.compile(rb"\d{33}")


def check_directory(file: IO[bytes], limits: ArchiveLimits) -> None:
    """Bound the number of entries before :mod:`zipfile` reads all of them into memory.

    Raises:
        Refused: Too many. Each entry begins with this mark, so counting marks cannot be fooled
            by what the zip says of itself.
    """
    count, tail = 0, b""
    while chunk := file.read(MIB):
        block = tail + chunk
        count += block.count(_DIRECTORY_ENTRY)
        tail = block[1 - len(_DIRECTORY_ENTRY) :]
    file.seek(0)
    if count > limits.members_with_tools:
        raise Refused(f"holds more than {limits.members} members")


def zip_members(archive: zipfile.ZipFile) -> Iterator[Member]:
    """List the members of a zip; of a link, read where it leads.

    Raises:
        Refused: A member is encrypted or compressed by a rare method.
    """
    for place, info in enumerate(archive.infolist()):
        name = _name(info)
        if info.flag_bits & _FLAG_ENCRYPTED:
            raise Refused(f"{shown(name)}: is encrypted; hand in a zip without a password")
        # The rare methods cannot be read in small steps, which bounds memory.
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise Refused(f"{shown(name)}: has a rare compression method; make a plain zip")
        mode = info.external_attr >> 16 if info.create_system == _MADE_BY_UNIX else 0
        kind = _kind(name, mode)
        target = ""
        if kind is Kind.LINK:
            if info.file_size > LONGEST_TARGET:
                raise Refused(f"{shown(name)}: the link's target is too long")
            target = archive.read(info).decode("utf-8", "surrogateescape")
        size = info.file_size if kind is Kind.FILE else 0
        yield Member(place, name, kind, size, bool(mode & 0o111), target)


def _name(info: zipfile.ZipInfo) -> str:
    # zipfile cuts `filename` at a NUL; `orig_filename` shows it.
    name = info.orig_filename
    if not info.flag_bits & _FLAG_UTF8:
        # macOS writes UTF-8 without saying so; read as code page 437 it would be garbled.
        try:
            name = name.encode("cp437").decode("utf-8")
        except UnicodeError:
            name = info.orig_filename
    return name.replace("\\", "/") if info.create_system == _MADE_BY_DOS else name


def _kind(name: str, mode: int) -> Kind:
    if stat.S_ISLNK(mode):
        return Kind.LINK
    if name.endswith("/") or stat.S_ISDIR(mode):
        return Kind.FOLDER
    return Kind.FILE if stat.S_IFMT(mode) in (0, stat.S_IFREG) else Kind.SPECIAL


class _Headers:
    """The file as :mod:`tarfile` sees it: no unbounded reads, since it only reads headers."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.seek, self.tell = file.seek, file.tell

    def read(self, size: int) -> bytes:
        if size > _LONGEST_HEADER:
            raise Refused("a header in it is too long")
        data = self._file.read(size)
        if size > _BLOCK and _DIGITS.search(data):
            raise Refused("a header in it is broken")
        return data


def tar_members(file: IO[bytes]) -> Iterator[Member]:
    """List the members of a tar; a hard link is listed as one more file with the same data.

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
    if info.issparse():
        raise Refused(f"{shown(info.name)}: sparse files are refused")
    if info.isreg():
        executable = bool(info.mode & 0o111)
        return Member(info.offset_data, info.name, Kind.FILE, info.size, executable)
    if info.islnk():
        first = files.get(info.linkname)
        if first is None:
            raise Refused(
                f"{shown(info.name)}: is a hard link to {shown(info.linkname)}, "
                "which does not stand before it in the archive"
            )
        return Member(first.place, info.name, Kind.FILE, first.size, first.executable)
    if info.issym():
        return Member(info.offset_data, info.name, Kind.LINK, target=info.linkname)
    return Member(info.offset_data, info.name, Kind.FOLDER if info.isdir() else Kind.SPECIAL)
