"""The table of contents of a zip, as members to be admitted."""

from __future__ import annotations

import stat
import zipfile
from collections.abc import Iterator
from typing import IO

from grader.submission.intake.members import MIB, ArchiveLimits, Kind, Member, Refused
from grader.submission.intake.paths import shown

_MADE_BY_DOS, _MADE_BY_UNIX = 0, 3
_FLAG_ENCRYPTED, _FLAG_UTF8 = 0x1, 0x800
_LONGEST_TARGET = 4096
_DIRECTORY_ENTRY = b"PK\x01\x02"


def check_directory(file: IO[bytes], limits: ArchiveLimits) -> None:
    """Bound the number of entries before :mod:`zipfile` reads all of them into memory.

    Args:
        file: The zip; left at its start.

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


def members(archive: zipfile.ZipFile) -> Iterator[Member]:
    """List the members; of a link, read where it leads.

    Raises:
        Refused: A member is encrypted or compressed by a rare method.
    """
    for place, info in enumerate(archive.infolist()):
        name = _name(info)
        if info.flag_bits & _FLAG_ENCRYPTED:
            raise Refused(f"{shown(name)}: is encrypted; hand in a zip without a password")
        # The rare methods cannot be read in small steps, which bounds memory.
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise Refused(f"{shown(name)}: is compressed by a rare method; make a plain zip")
        mode = info.external_attr >> 16 if info.create_system == _MADE_BY_UNIX else 0
        kind = _kind(name, mode)
        target = ""
        if kind is Kind.LINK:
            if info.file_size > _LONGEST_TARGET:
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
    if info.create_system == _MADE_BY_DOS:
        name = name.replace("\\", "/")
    return name


def _kind(name: str, mode: int) -> Kind:
    if stat.S_ISLNK(mode):
        return Kind.LINK
    if name.endswith("/"):
        return Kind.FOLDER
    if stat.S_IFMT(mode) in (0, stat.S_IFREG):
        return Kind.FILE
    return Kind.FOLDER if stat.S_ISDIR(mode) else Kind.SPECIAL
