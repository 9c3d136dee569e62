"""Grading a submission again whenever a file of it was saved."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from watchfiles import Change, watch

from grader.assignment.load import folder_sha256
from grader.batch.grading import Graded
from grader.errors import GraderFault, RosgradeError
from grader.submission.intake.leftovers import is_left_out
from grader.submission.prepare import fingerprint

_SETTLED_MS = 50
"""An editor writes, renames and deletes to save one file: all of it is one change."""
_LONGEST_MS = 400
"""Of a stream of changes, the first are acted on after this time."""


class Worker(Protocol):
    """Grades the submission as it is now."""

    def begin(self) -> None:
        """Get ready; called before a thread of its own calls :meth:`grade`."""

    def grade(self) -> Graded:
        """Grade it.

        Raises:
            RosgradeError: It could not be graded.
        """

    def cancel(self) -> None:
        """End :meth:`grade`, which may then return or raise anything."""


@dataclass(frozen=True)
class Began:
    """A grading begins."""


@dataclass(frozen=True)
class Cancelled:
    """A grading was ended by a change; the next one begins."""


@dataclass(frozen=True)
class Ended:
    """A grading ended by itself.

    Attributes:
        graded: What came of it, or None.
        problem: Why nothing came of it, or None.
    """

    graded: Graded | None = None
    problem: RosgradeError | None = None


@dataclass(frozen=True)
class _State:
    """What is there, as hashes."""

    submission: str
    assignment: str


@dataclass(frozen=True)
class _Saved:
    """A file was saved."""


@dataclass(frozen=True)
class _Blind:
    """The files cannot be watched any more."""

    error: Exception


@dataclass(frozen=True)
class _Done:
    """The grading is over."""

    graded: Graded | None = None
    error: BaseException | None = None


class Watching:
    """Grades at first and then at every change, until the one who iterates has enough."""

    def __init__(
        self, submission: Path, report: Path, worker: Worker, assignment: Path | None = None
    ) -> None:
        """Set up; nothing is watched yet."""
        self._submission = submission
        self._report = report.resolve()
        self._assignment = assignment.resolve() if assignment is not None else None
        self._worker = worker
        self._told: queue.SimpleQueue[_Saved | _Blind | _Done] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._grading: threading.Thread | None = None

    def events(self) -> Iterator[Began | Cancelled | Ended]:
        """Watch and grade.

        Raises:
            GraderFault: The files cannot be watched.
        """
        watching = [
            threading.Thread(target=look, name="watch", daemon=True)
            for look in (self._watch_submission, self._watch_assignment)
        ]
        for thread in watching:
            thread.start()
        try:
            while True:
                state = self._fingerprint()
                yield Began()
                self._begin()
                event = self._await_end(state)
                yield event
                if isinstance(event, Ended):
                    # It may have been saved between the look at it and the copy that was graded.
                    graded = event.graded
                    sha256 = graded.prepared.record.sha256 if graded else state.submission
                    self._await_other(replace(state, submission=sha256))
        finally:
            self._stop.set()
            self._cancel()
            for thread in watching:
                thread.join()

    def _begin(self) -> None:
        self._worker.begin()
        self._grading = threading.Thread(target=self._grade, name="grade")
        self._grading.start()

    def _grade(self) -> None:
        try:
            self._told.put(_Done(graded=self._worker.grade()))
        except BaseException as error:
            self._told.put(_Done(error=error))

    def _await_end(self, state: _State) -> Cancelled | Ended:
        """Wait for the end of the grading, or for another content, which ends it."""
        assert self._grading is not None
        while True:
            told = self._next()
            if isinstance(told, _Done):
                self._grading.join()
                self._grading = None
                if told.error is not None and not isinstance(told.error, RosgradeError):
                    raise told.error
                return Ended(told.graded, told.error)
            if self._fingerprint() != state:
                self._cancel()
                return Cancelled()

    def _await_other(self, state: _State) -> None:
        while self._fingerprint() == state:
            self._next()

    def _next(self) -> _Saved | _Done:
        told = self._told.get()
        if isinstance(told, _Blind):
            raise GraderFault(f"the files cannot be watched: {told.error}")
        return told

    def _cancel(self) -> None:
        """End the grading; what it says at its end is nobody's concern."""
        grading, self._grading = self._grading, None
        if grading is None:
            return
        self._worker.cancel()
        grading.join()
        while not self._told.empty():
            self._told.get()

    def _fingerprint(self) -> _State:
        """What is there now; nothing where it cannot be read, as in the middle of a save."""
        try:
            submission = fingerprint(self._submission)
        except RosgradeError:
            submission = ""
        try:
            folder = self._assignment
            assignment = folder_sha256(folder, self._report) if folder is not None else ""
        except RosgradeError:
            assignment = ""
        return _State(submission, assignment)

    def _watch_assignment(self) -> None:
        folder = self._assignment
        if folder is None:
            return

        def concerns(_: Change, path: str) -> bool:
            changed = Path(path)
            return not changed.is_relative_to(self._report)

        self._watch(folder, concerns, recursive=True)

    def _watch_submission(self) -> None:
        is_folder = self._submission.is_dir()
        root = self._submission.resolve() if is_folder else self._submission.resolve().parent
        name = self._submission.resolve().name

        def concerns(_: Change, path: str) -> bool:
            changed = Path(path)
            if changed.is_relative_to(self._report):
                return False
            if not is_folder:
                return changed.name == name
            return not is_left_out(changed.relative_to(root).as_posix())

        self._watch(root, concerns, recursive=is_folder)

    def _watch(
        self, root: Path, concerns: Callable[[Change, str], bool], *, recursive: bool
    ) -> None:
        try:
            for _ in watch(
                root,
                watch_filter=concerns,
                debounce=_LONGEST_MS,
                step=_SETTLED_MS,
                stop_event=self._stop,
                recursive=recursive,
                raise_interrupt=False,
            ):
                self._told.put(_Saved())
        except OSError as error:
            self._told.put(_Blind(error))
