"""Files, written whole or not at all."""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote

from grader.errors import UsageError, machine_fault

# What packages, assignments and results are made of; anything else in a folder may be replaced.
_SOURCES = re.compile(
    r".*\.(py|c|cc|cpp|h|hpp|msg|srv|action|cfg|toml|ya?ml|sh|launch|csv|mcap|zip|t?gz)"
    r"|package\.xml|CMakeLists\.txt|README.*|LICENSE.*|result\.json|submission\.json",
    re.IGNORECASE,
)
_LONGEST_NAME = 120


def folder_name(key: str) -> str:
    """A folder's name for a key: readable, safe, and another one for every key."""
    name = quote(key, safe=" @+,()=").strip(" ").replace(".", "%2E", key.startswith(".")) or "_"
    # Case must not matter where the results are copied to, nor may a name be too long there.
    if len(name) > _LONGEST_NAME or name != key:
        name = f"{name[:_LONGEST_NAME]}-{hashlib.sha256(key.encode()).hexdigest()[:8]}"
    return name


STANDARD_OUTPUT = Path("-")


def write_whole(file: Path, content: str | bytes, *, durable: bool = False) -> None:
    """Write a file under a temporary name beside it, then move it into place.

    A reader sees the old file or the new one, never half of it. Missing folders are made;
    text is written as UTF-8. `-` is standard output.

    Args:
        durable: Return only when it would survive a power cut.

    Raises:
        UsageError: It cannot be written there.
        GraderFault: The disk is full or broken, or files may not be so large.
    """
    data = content.encode() if isinstance(content, str) else content
    if file == STANDARD_OUTPUT:
        # Not sys.stdout, which may stand for stderr meanwhile. Who reads no further wants no more.
        with suppress(BrokenPipeError), open(1, "wb", closefd=False) as stream:
            stream.write(data)
        return
    # Such as /dev/null or /dev/stdout, which must stay what they are.
    special = file.exists() and not (file.is_file() or file.is_dir())
    draft = file.with_name(f".{file.name}.{secrets.token_hex(4)}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            if special:
                file.write_bytes(data)
                return
            # "x" and not mkstemp: the file gets the permissions that the user's umask gives.
            with draft.open("xb") as stream:
                stream.write(data)
                if durable:
                    stream.flush()
                    os.fsync(stream.fileno())
            draft.replace(file)
            # The folder may be new too.
            for folder in file.absolute().parents[:2] if durable else ():
                sync(folder)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        refusal = UsageError(f"{file} cannot be written: {_why(file, error)}")
        raise machine_fault(error, file) or refusal from error


def file_version(file: Path) -> object:
    """What is another one for each version of a file; None where there is none."""
    try:
        known = file.stat()
    except OSError:
        return None
    return known.st_ino, known.st_size, known.st_mtime_ns


def sync(path: Path) -> None:
    """Make a written file, or the renames in a folder, survive a power cut."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def refuse_inputs(outputs: Iterable[Path | None], inputs: Iterable[Path | None]) -> None:
    """See that no output takes the place of an input, or of another output.

    Args:
        outputs: Files and folders that the command writes; None for an option that is not used.
        inputs: Files and folders that it reads. In a folder among them a file may be written
            that is new or no source, such as the output of an earlier run.
    """
    written: list[Path] = []
    read = [one for one in inputs if one is not None]
    for output in (one for one in outputs if one is not None):
        for other in read:
            if _is_same(output, other):
                raise UsageError(f"{output}: this command reads it, so it is not overwritten")
            if _is_of(output, other):
                raise UsageError(
                    f"{output}: is a file of {other}, which this command reads, so it is not "
                    "overwritten"
                )
        if any(_is_same(output, other) for other in written):
            raise UsageError(f"{output}: is given for two outputs")
        written.append(output)


def refuse_part(output: Path, folder: Path, what: str) -> None:
    """See that nothing is written into a folder that is read as a whole."""
    if Path(os.path.realpath(output)).is_relative_to(os.path.realpath(folder)):
        raise UsageError(f"{output}: lies in {what}; use another folder")


def _is_same(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file or folder, also by a symbolic or a hard link."""
    try:
        return one.samefile(other)
    except OSError:
        return os.path.realpath(one) == os.path.realpath(other)


def _is_of(file: Path, folder: Path) -> bool:
    """Whether a file is a source in a folder."""
    if not (file.is_file() and folder.is_dir()):
        return False
    inside = os.path.relpath(os.path.realpath(file), os.path.realpath(folder)).split("/")
    # Reports are no part of what is graded, even if other files are in their place.
    if inside[0] == ".." or "rosgrade-report" in inside:
        return False
    return _SOURCES.fullmatch(inside[-1]) is not None


def check_folder(folder: Path) -> None:
    """See that a folder is there, or that nothing is in its place."""
    other = _in_the_way(folder)
    if other is not None:
        named = "" if other == folder else f"{other} "
        raise UsageError(f"{folder}: {named}is not a folder; use another place")


def _in_the_way(folder: Path) -> Path | None:
    """The file that is in the place of a needed folder."""
    there = next((one for one in (folder, *folder.parents) if os.path.lexists(one)), None)
    return None if there is None or there.is_dir() else there


def _why(file: Path, error: OSError) -> str:
    if error.errno == errno.EISDIR:
        return "it is a folder; give a file"
    other = _in_the_way(file.parent) if error.errno in (errno.ENOTDIR, errno.EEXIST) else None
    return f"{other} is not a folder" if other else error.strerror or str(error)
