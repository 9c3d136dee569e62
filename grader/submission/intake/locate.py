"""Open a submission: a folder or an archive becomes a private copy that no longer changes.

So the student may go on editing, and rosgrade cannot change the original.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from grader.errors import UsageError
from grader.machine.scratch import Scratch
from grader.submission.intake import archive
from grader.submission.intake.listing import (
    ChangedMeanwhile,
    SubmissionFile,
    find_packages,
    inside,
    list_files,
    unreadable,
    wrapper_of,
)
from grader.submission.intake.paths import shown

NO_FILES = hashlib.sha256().hexdigest()
"""The hash of a submission that is empty."""
_CHUNK = 1024 * 1024
# Before it is read again because it was written to meanwhile.
_PAUSES_S = (0.05, 0.5)
_URL = re.compile(r"(https?|ssh|git|file|ftp):/|[\w.-]+@[\w.-]+:")


@dataclass(frozen=True)
class Located:
    """An opened submission.

    Attributes:
        sha256: Hash over the files' paths, contents and executable bits, as hex.
        root: The private copy; holds exactly ``files``, which are sorted by path.
        packages: Folders with a ``package.xml``, sorted; ``.`` for the submission itself.
        leftovers: What builds and runs made and was handed in too; it is not in the copy.
    """

    id: str
    sha256: str
    root: Path
    files: tuple[SubmissionFile, ...]
    packages: tuple[str, ...]
    leftovers: tuple[str, ...] = ()


@contextmanager
def opened(path: Path | str) -> Iterator[Located]:
    """Open a folder, or an archive of one, for as long as the context lasts.

    Raises:
        UsageError: Nothing is there, or it is a URL.
        SubmissionError: It cannot be read as a submission.
        GraderFault: This machine cannot hold the copy.
    """
    source = check_path(path)
    with Scratch("submission") as scratch:
        listed, leftovers = source, set[str]()
        if not source.is_dir():
            listed = scratch / "unpacked"
            listed.mkdir()
            archive.unpack(source, listed, leftovers=leftovers)
        root = scratch / "submission"
        files, sha256 = _snapshot(listed, root, leftovers)
        if leftovers and listed is not source:
            # Two archives that differ in them are two submissions. In a folder they come and go.
            names = "\0".join(sorted(leftovers))
            sha256 = hashlib.sha256(f"{sha256}\0{names}".encode("utf-8", "replace")).hexdigest()
        yield Located(
            id=submission_id(source),
            sha256=sha256,
            root=root,
            files=tuple(files),
            packages=tuple(find_packages(file.path for file in files)),
            leftovers=tuple(sorted(map(shown, leftovers))),
        )


@contextmanager
def only(located: Located, folder: str, name: str) -> Iterator[Located]:
    """Open one package of a submission, which lies in a folder of it, without the others.

    Raises:
        GraderFault: This machine cannot hold the copy.
    """
    files = inside(located.files, folder)
    with tempfile.TemporaryDirectory(prefix="apart-", dir=located.root.parent) as scratch:
        root = Path(scratch, "submission")
        root.mkdir()
        sha256 = _copy(located.root / folder, files, root / name)
        moved = tuple(replace(file, path=f"{name}/{file.path}") for file in files)
        yield Located(located.id, sha256, root, moved, (name,))


def check_path(path: Path | str) -> Path:
    """The path of a submission that exists; anything else is a wrong use."""
    text = os.fspath(path)
    if _URL.match(text):
        # A Path holds one of the two slashes.
        address = re.sub(r"^(\w+:)/+", r"\1//", text)
        raise UsageError(f"{shown(address)}: is a URL; clone it with git and give the folder")
    source = Path(path)
    if not (source.is_dir() or source.is_file()):
        problem = "is neither a folder nor a file" if source.exists() else "does not exist"
        raise UsageError(f"{shown(text)}: {problem}")
    return source


def submission_id(source: Path) -> str:
    """Name a submission after its folder or archive."""
    name = source.name if source.name not in ("", "..") else source.resolve().name
    name = name or "submission"
    if not source.is_dir():
        suffix = next((s for s in archive.SUFFIXES if name.lower().endswith(s)), "")
        name = name[: len(name) - len(suffix)] or name
    return shown(name)


def _snapshot(source: Path, root: Path, leftovers: set[str]) -> tuple[list[SubmissionFile], str]:
    """Copy a folder as it was at one moment, as far as one can tell."""
    for pause_s in (*_PAUSES_S, None):
        try:
            files = list_files(source, leftovers=leftovers)
            wrapper = wrapper_of(files)
            files = inside(files, wrapper)
            return files, _copy(source / wrapper, files, root)
        except ChangedMeanwhile:
            if pause_s is None:
                raise
            shutil.rmtree(root, ignore_errors=True)
            time.sleep(pause_s)
    raise AssertionError  # the last attempt returned or raised


def _copy(source: Path, files: Sequence[SubmissionFile], root: Path) -> str:
    """Copy the listed files and hash what was copied, so that both agree for certain."""
    total = hashlib.sha256()
    root.mkdir()
    for file in files:
        target = root / file.path
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            if file.link is not None:
                target.symlink_to(file.link)
                digest, kind = hashlib.sha256(os.fsencode(file.link)).digest(), b"l"
            else:
                digest = _copy_file(source / file.path, target, file)
                kind = b"x" if file.executable else b"f"
        except OSError as error:
            raise unreadable(file.path, error) from error
        # A NUL ends the path: no path contains one.
        total.update(kind + os.fsencode(file.path) + b"\0" + digest)
    return total.hexdigest()


def _copy_file(source: Path, target: Path, file: SubmissionFile) -> bytes:
    digest = hashlib.sha256()
    left = file.size
    # Not following a link that was put there since the listing; not waiting for a pipe either.
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK
    mode = 0o755 if file.executable else 0o644
    with (
        os.fdopen(os.open(source, flags), "rb") as reading,
        os.fdopen(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as writing,
    ):
        while block := reading.read(min(_CHUNK, left)):
            digest.update(block)
            writing.write(block)
            left -= len(block)
        if left or reading.read(1):
            # Half a file that is just being saved would be graded as a whole one.
            raise ChangedMeanwhile(file.path)
    return digest.digest()
