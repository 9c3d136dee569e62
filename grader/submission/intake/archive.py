"""Unpack a student's archive into a fresh folder, safely even if it is hostile.

:mod:`zipfile` and :mod:`tarfile` only read the table of contents,
:func:`~grader.submission.intake.members.admit` decides, and files are written here. So it does not
matter whether this Python's ``tarfile`` already has the data filter.

What is made: folders, files (0644, or 0755 when anyone could execute them), hard links as
copies and, last, symbolic links that lead to something inside. Owners, times, setuid bits and
other modes are dropped.
"""

from __future__ import annotations

import bz2
import errno
import gzip
import lzma
import os
import struct
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import IO

from grader.errors import GraderFault, SubmissionError, machine_fault
from grader.submission.intake.contents import check_directory, tar_members, zip_members
from grader.submission.intake.members import MIB, ArchiveLimits, Kind, Member, Refused, admit
from grader.submission.intake.paths import shown

SUFFIXES = (".tar.gz", ".tar.bz2", ".tar.xz", ".tgz", ".tbz2", ".txz", ".tar", ".zip")

_CHUNK = 64 * 1024
_LZMA_MEMORY = 256 * MIB
_BROKEN = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    tarfile.TarError,
    zlib.error,
    lzma.LZMAError,
    gzip.BadGzipFile,
    struct.error,
    EOFError,
    ValueError,
    OverflowError,
    NotImplementedError,
)


def unpack(
    archive: Path,
    into: Path,
    limits: ArchiveLimits | None = None,
    leftovers: set[str] | None = None,
) -> None:
    """Unpack a zip or a plain or compressed tar; they are told apart by content.

    Args:
        into: An existing, empty folder.
        leftovers: Gets the paths of what builds and runs made, which is not unpacked.

    Raises:
        SubmissionError: It is no archive, broken, encrypted, unsafe or too large; names the
            archive and the member. ``into`` may then hold some of its files.
    """
    limits = limits or ArchiveLimits()
    name = shown(archive.name)
    with _translated(name), archive.open("rb") as file, tempfile.TemporaryFile() as scratch:
        size = os.fstat(file.fileno()).st_size
        if size > limits.total_bytes:
            raise SubmissionError(
                f"{name}: is larger than {limits.total_bytes // MIB} MiB; hand in the sources only"
            )
        start = file.read(512)
        file.seek(0)
        if start.startswith((b"PK\x03\x04", b"PK\x05\x06")):
            check_directory(file, limits)
            zipped = zipfile.ZipFile(file)
            infos, found = zipped.infolist(), zip_members(zipped)

            def content(member: Member) -> IO[bytes]:
                return zipped.open(infos[member.place])
        else:
            plain = _plain_tar(file, start, name, scratch, limits)
            found = tar_members(plain)

            def content(member: Member) -> IO[bytes]:
                plain.seek(member.place)
                return plain

        entries = admit(found, archive=name, archive_bytes=size, limits=limits, leftovers=leftovers)
        _make(entries, content, into)


@contextmanager
def _translated(name: str) -> Iterator[None]:
    try:
        yield
    except Refused as error:
        raise SubmissionError(f"{name}: {error}") from error
    except _BROKEN as error:
        raise SubmissionError(f"{name}: is broken and cannot be unpacked ({error})") from error
    except MemoryError as error:
        raise SubmissionError(f"{name}: needs too much memory to be unpacked") from error
    except OSError as error:
        # bz2 raises it without a number, and zipfile and tarfile seek to wherever a broken
        # archive tells them to.
        if error.errno in (None, errno.EINVAL):
            raise SubmissionError(f"{name}: is broken and cannot be unpacked") from error
        fault = GraderFault(f"{name}: could not be unpacked here: {error}")
        raise machine_fault(error) or fault from error


def _plain_tar(
    file: IO[bytes], start: bytes, name: str, scratch: IO[bytes], limits: ArchiveLimits
) -> IO[bytes]:
    if start.startswith(b"\x1f\x8b"):
        blocks = iter(partial(gzip.GzipFile(fileobj=file).read, _CHUNK), b"")
    elif start.startswith(b"BZh"):
        blocks = iter(partial(bz2.BZ2File(file).read, _CHUNK), b"")
    elif start.startswith(b"\xfd7zXZ\x00"):
        blocks = _xz_blocks(file)
    elif start[257:262] == b"ustar" or name.lower().endswith(".tar"):
        return file
    else:
        if not start:
            raise Refused("is empty: it holds 0 bytes")
        raise Refused("is neither a folder nor a .zip or .tar.gz archive")
    # A tar has up to two blocks of 512 bytes beside each member, and what is left out of it
    # counts here as well.
    most = 2 * (limits.total_bytes + 1024 * limits.members)
    size = os.fstat(file.fileno()).st_size
    total = 0
    for block in blocks:
        total += len(block)
        if total > most or total > max(limits.ratio_from_bytes, limits.ratio * size):
            raise Refused(
                f"unpacks to more than {limits.total_bytes // MIB} MiB "
                f"or {limits.ratio} times its size"
            )
        scratch.write(block)
    scratch.seek(0)
    return scratch


def _xz_blocks(file: IO[bytes]) -> Iterator[bytes]:
    # lzma.open has no memory limit, and the file itself says how much its decoder allocates.
    decoder = lzma.LZMADecompressor(memlimit=_LZMA_MEMORY)
    ahead = b""
    while True:
        if decoder.eof:
            ahead = decoder.unused_data.lstrip(b"\0") or file.read(_CHUNK).lstrip(b"\0")
            if not ahead:
                return
            decoder = lzma.LZMADecompressor(memlimit=_LZMA_MEMORY)
        elif decoder.needs_input:
            ahead = file.read(_CHUNK)
            if not ahead:
                raise EOFError("the compressed file ends too early")
        yield decoder.decompress(ahead, _CHUNK)
        ahead = b""


def _make(members: list[Member], content: Callable[[Member], IO[bytes]], into: Path) -> None:
    # Links come last, so that nothing is written through one.
    for member in sorted(members, key=lambda member: member.kind is Kind.LINK):
        path = into / member.name
        path.parent.mkdir(parents=True, exist_ok=True)
        if member.kind is Kind.FILE:
            _write(content(member), member, path)
        elif member.kind is Kind.FOLDER:
            path.mkdir(exist_ok=True)
        else:
            path.symlink_to(member.target)


def _write(source: IO[bytes], member: Member, path: Path) -> None:
    # O_EXCL does not follow links, should one be there against all reason.
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    left = member.size
    with os.fdopen(os.open(path, flags, 0o755 if member.executable else 0o644), "wb") as file:
        while left:
            block = source.read(min(_CHUNK, left))
            if not block:
                raise EOFError(f"{shown(member.name)} ends too early")
            file.write(block)
            left -= len(block)
