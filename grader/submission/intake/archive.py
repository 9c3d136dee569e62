"""Unpack a student's archive into a fresh folder, whatever it holds.

No member is extracted by :mod:`zipfile` or :mod:`tarfile` themselves: they only read the table
of contents, :func:`~grader.submission.intake.members.admit` decides, and files are written here. So
it does not matter whether this Python's ``tarfile`` already has the data filter.

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
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, cast

from grader.errors import GraderFault, SubmissionError
from grader.submission.intake import tars, zips
from grader.submission.intake.members import MIB, ArchiveLimits, Entry, Kind, Refused, admit
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
_FOREIGN = {
    b"Rar!": "a RAR archive",
    b"7z\xbc\xaf": "a 7z archive",
    b"\x28\xb5\x2f\xfd": "a Zstandard archive",
}


def unpack(archive: Path, into: Path, limits: ArchiveLimits | None = None) -> None:
    """Unpack a zip or a plain or compressed tar; they are told apart by content.

    Args:
        into: An existing, empty folder that nobody else uses.

    Raises:
        SubmissionError: It is no archive, broken, encrypted, unsafe or too large; names the
            archive and the member. ``into`` may then hold some of its files.
        GraderFault: It could not be read or written here (permissions, disk full).
    """
    limits = limits or ArchiveLimits()
    name = shown(archive.name)
    with _translated(name), archive.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        if size > limits.total_bytes:
            raise SubmissionError(
                f"{name}: is larger than {limits.total_bytes // MIB} MiB; hand in the sources only"
            )
        start = file.read(512)
        file.seek(0)
        if start.startswith((b"PK\x03\x04", b"PK\x05\x06")):
            _unpack_zip(file, name, into, limits)
        else:
            with tempfile.TemporaryFile() as scratch:
                plain = _plain_tar(file, start, name, scratch, limits)
                _unpack_tar(plain, name, size, into, limits)


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
        raise GraderFault(f"{name}: could not be unpacked here: {error}") from error


def _unpack_zip(file: IO[bytes], name: str, into: Path, limits: ArchiveLimits) -> None:
    size = os.fstat(file.fileno()).st_size
    zips.check_directory(file, limits)
    with zipfile.ZipFile(file) as archive:
        found = zips.members(archive)
        entries = admit(found, archive=name, archive_bytes=size, limits=limits)
        infos = archive.infolist()
        for entry in _files(entries):
            with archive.open(infos[entry.member.place]) as source:
                _write(source, entry, into)
    _make_folders_and_links(entries, into)


def _unpack_tar(plain: IO[bytes], name: str, size: int, into: Path, limits: ArchiveLimits) -> None:
    found = tars.members(plain)
    entries = admit(found, archive=name, archive_bytes=size, limits=limits)
    for entry in _files(entries):
        plain.seek(entry.member.place)
        _write(plain, entry, into)
    _make_folders_and_links(entries, into)


def _files(entries: list[Entry]) -> list[Entry]:
    return [entry for entry in entries if entry.member.kind is Kind.FILE]


def _plain_tar(
    file: IO[bytes], start: bytes, name: str, scratch: IO[bytes], limits: ArchiveLimits
) -> IO[bytes]:
    if start.startswith(b"\x1f\x8b"):
        blocks = _blocks(cast("IO[bytes]", gzip.GzipFile(fileobj=file)))
    elif start.startswith(b"BZh"):
        blocks = _blocks(cast("IO[bytes]", bz2.BZ2File(file)))
    elif start.startswith(b"\xfd7zXZ\x00"):
        blocks = _xz_blocks(file)
    elif start[257:262] == b"ustar" or name.lower().endswith(".tar"):
        return file
    else:
        for mark, what in _FOREIGN.items():
            if start.startswith(mark):
                raise Refused(f"is {what}; hand in a .zip or .tar.gz")
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


def _blocks(file: IO[bytes]) -> Iterator[bytes]:
    while block := file.read(_CHUNK):
        yield block


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


def _write(source: IO[bytes], entry: Entry, into: Path) -> None:
    path = into / entry.path
    path.parent.mkdir(parents=True, exist_ok=True)
    left = entry.member.size
    with _created(path, entry.member.executable) as file:
        while left:
            block = source.read(min(_CHUNK, left))
            if not block:
                raise EOFError(f"{shown(entry.path)} ends too early")
            file.write(block)
            left -= len(block)


def _created(path: Path, executable: bool) -> IO[bytes]:
    # O_EXCL does not follow links, should one be there against all reason.
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    return os.fdopen(os.open(path, flags, 0o755 if executable else 0o644), "wb")


def _make_folders_and_links(entries: list[Entry], into: Path) -> None:
    for entry in entries:
        if entry.member.kind is Kind.FOLDER:
            (into / entry.path).mkdir(parents=True, exist_ok=True)
    links = [entry for entry in entries if entry.member.kind is Kind.LINK]
    for entry in links:
        (into / entry.path).parent.mkdir(parents=True, exist_ok=True)
    for entry in links:
        (into / entry.path).symlink_to(entry.member.target)
