"""The review files of a class: read, written and undone so that nothing is lost.

Two people may write at once, and a file may be edited by hand meanwhile: a writer shows the version
of the file that they read, and a file of another version is never overwritten. What a write
replaces is kept in ``OUT/review/history/``, so an undo also works after the machine died.
"""

from __future__ import annotations

import fcntl
import hashlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from grader.errors import UsageError, machine_fault
from grader.report.files import folder_name, sync, write_whole
from grader.review.model import ClassReview, StudentReview
from grader.spec.document import write_yaml
from grader.spec.source import Model, parse_source, read_source

CLASS_FILE = "class.yaml"
R = TypeVar("R", bound=Model)


class ReviewConflict(UsageError):
    """The file is not the one that the writer read; nothing was written."""


@dataclass(frozen=True)
class Saved(Generic[R]):
    """A review with the version of its file; ``""`` where there is no file yet."""

    content: R
    version: str


class ReviewStore:
    """The folder ``OUT/review/`` of a class; it is made by the first write."""

    def __init__(self, out: Path) -> None:
        """Name the folder of the class."""
        self.folder = out / "review"

    def file(self, key: str | None) -> Path:
        """The file of a student's review; with None that of the class."""
        if key is None:
            return self.folder / CLASS_FILE
        file = self.folder / f"{folder_name(key)}.yaml"
        # A student may be called like the file of the class; no other name has this sign in it.
        return file.with_stem("class#") if file.name == CLASS_FILE else file

    def student(self, key: str) -> Saved[StudentReview]:
        """The review of a student, empty where nothing is written yet.

        Raises:
            AssignmentError: The file is nonsense; named with its lines.
        """
        saved = _read(self.file(key), StudentReview, StudentReview(key=key))
        if saved.content.key != key:
            raise UsageError(f"{self.file(key)}: is the file of {key}, not of {saved.content.key}")
        return saved

    def of_class(self) -> Saved[ClassReview]:
        """What is written about the whole class; see :meth:`student`."""
        return _read(self.file(None), ClassReview, ClassReview())

    def vanished(self, keys: Collection[str]) -> tuple[str, ...]:
        """Students with a review who are not in the class any more; reads only theirs."""
        known = {CLASS_FILE, *(self.file(key).name for key in keys)}
        files = [file for file in sorted(self.folder.glob("*.yaml")) if file.name not in known]
        reviews = [read_source(file).read(StudentReview) for file in files]
        return tuple(one.key for one in reviews if one.key not in keys)

    def save(self, content: StudentReview | ClassReview, version: str) -> str:
        """Write a review, and keep what it replaces.

        Args:
            version: Of the file that the writer read.

        Returns:
            The version of the new file.

        Raises:
            ReviewConflict: It has another version by now; nothing was written.
        """
        file = self.file(content.key if isinstance(content, StudentReview) else None)
        written = content.model_dump(mode="json", exclude_defaults=True)
        text = write_yaml(dict(sorted(written.items(), key=lambda item: item[0] != "key")))
        # What cannot be read again must not replace what can.
        parse_source(text, file).read(type(content))
        with self._writing():
            before = self._unchanged(file, version)
            folder, kept = self._history(file)
            write_whole(folder / f"{len(kept):06}.yaml", before, durable=True)
            write_whole(file, text, durable=True)
        return _version(text.encode())

    def undo(self, key: str | None, version: str) -> str:
        """Put back what the last write to a file replaced.

        Args:
            key: Of the student; None for the file of the class.
            version: Of the file that is there now, so that no other person's write is undone.

        Returns:
            The version of the file that is put back.
        """
        file = self.file(key)
        with self._writing():
            self._unchanged(file, version)
            _, kept = self._history(file)
            if not kept:
                raise UsageError(f"{file}: there is nothing to undo")
            before = kept[-1].read_bytes()
            if before:
                write_whole(file, before, durable=True)
            else:
                file.unlink()
            kept[-1].unlink()
            sync(self.folder)
        return _version(before)

    def _unchanged(self, file: Path, version: str) -> bytes:
        before = file.read_bytes() if file.exists() else b""
        if _version(before) != version:
            raise ReviewConflict(
                f"{file}: was changed meanwhile, by another person or in another window. "
                "Nothing was written; load it again and repeat your change"
            )
        return before

    def _history(self, file: Path) -> tuple[Path, list[Path]]:
        folder = self.folder / "history" / file.stem
        return folder, sorted(folder.glob("*.yaml"))

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Let one process or thread write at a time."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with (self.folder / ".lock").open("w") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                yield
        except OSError as error:
            refusal = UsageError(f"{self.folder}: cannot be written: {error.strerror}")
            raise machine_fault(error, self.folder) or refusal from error


def _read(file: Path, model: type[R], empty: R) -> Saved[R]:
    if not file.exists():
        return Saved(empty, "")
    try:
        # Before the content: of a file that changes meanwhile it is too old, so no write takes it.
        version = _version(file.read_bytes())
    except OSError as error:
        raise UsageError(f"{file}: cannot be read: {error.strerror}") from error
    return Saved(read_source(file).read(model), version)


def _version(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16] if data else ""
