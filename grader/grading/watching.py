"""Grading a submission again whenever a file of it was saved."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol, TypeVar

from watchfiles import Change, watch

from grader.assignment.load import folder_sha256
from grader.errors import GraderFault, RosgradeError
from grader.grading.graded import Graded
from grader.submission.intake.leftovers import is_left_out
from grader.submission.prepare import fingerprint

_SETTLED_MS = 50
"""An editor writes, renames and deletes to save one file: all of it is one change."""
_LONGEST_MS = 400
"""Of a stream of changes, the first are acted on after this time."""

_LOOK_MS = 500
"""How often it is looked whether a watched folder is still the one at its path."""

T = TypeVar("T")


class Worker(Protocol):
    """Grades the submission as it is now."""

    def begin(self) -> None:
        """Get ready; called before a thread of its own calls :meth:`grade`."""

    def grade(self) -> Graded:
        """Grade it."""

    def cancel(self) -> None:
        """End :meth:`grade`, which may then return or raise anything."""


class Step(Enum):
    """Events of watching other than the end of a grading."""

    BEGAN = "a grading begins"
    CANCELLED = "a grading was ended by a change; the next one begins"


@dataclass(frozen=True)
class Ended:
    """A grading ended by itself."""

    graded: Graded | None = None
    problem: RosgradeError | None = None


class Watching:
    """Grades at first and then at every change, as long as its events are asked for."""

    def __init__(self, submission: Path, report: Path, worker: Worker, assignment: Path) -> None:
        """Set up; nothing is watched yet."""
        self._submission = submission.resolve()
        self._report = report.resolve()
        self._assignment = assignment.resolve()
        self._worker = worker
        # A future that is done, or None for a file that was saved.
        self._news: SimpleQueue[Future[Any] | None] = SimpleQueue()
        self._watches: list[Future[None]] = []
        self._stop = threading.Event()

    def events(self) -> Iterator[Step | Ended]:
        """Watch and grade."""
        with ThreadPoolExecutor(3, "watch") as pool:
            for look in (self._watch_submission, self._watch_assignment):
                self._watches.append(self._start(pool, look))
            grading: Future[Graded] | None = None
            try:
                while True:
                    state = self._state()
                    yield Step.BEGAN
                    self._worker.begin()
                    grading = self._start(pool, self._worker.grade)
                    if self._is_finished_before_a_change(grading, state):
                        ended, grading = _ended(grading), None
                        yield ended
                        # A save between this look and the copy that was graded counts as one.
                        graded = ended.graded
                        sha256 = graded.prepared.record.sha256 if graded else state[0]
                        while self._state() == (sha256, state[1]):
                            self._next()
                    else:
                        self._cancel(grading)
                        yield Step.CANCELLED
            finally:
                self._stop.set()
                if grading is not None:
                    self._cancel(grading)

    def _is_finished_before_a_change(self, grading: Future[Graded], state: tuple[str, str]) -> bool:
        """Wait until a grading ends, or the files are others than at its beginning."""
        while True:
            if self._next() is grading:
                return True
            if self._state() != state:
                return False

    def _start(self, pool: ThreadPoolExecutor, work: Callable[[], T]) -> Future[T]:
        future = pool.submit(work)
        future.add_done_callback(self._news.put)
        return future

    def _next(self) -> Future[Any] | None:
        news = self._news.get()
        error = news.exception() if news in self._watches else None
        if error is not None:
            raise GraderFault(f"the files cannot be watched: {error}")
        return news

    def _cancel(self, grading: Future[Graded]) -> None:
        self._worker.cancel()
        wait([grading])
        while not self._news.empty():
            self._news.get()

    def _state(self) -> tuple[str, str]:
        """Hashes of submission and assignment, empty where one cannot be read, as during a save."""
        submission = assignment = ""
        with contextlib.suppress(RosgradeError):
            submission = fingerprint(self._submission)
        with contextlib.suppress(RosgradeError):
            assignment = folder_sha256(self._assignment, self._report)
        return submission, assignment

    def _watch_assignment(self) -> None:
        self._watch(self._assignment, lambda _: True)

    def _watch_submission(self) -> None:
        root = self._submission
        if root.is_dir():
            self._watch(root, lambda path: not is_left_out(path.relative_to(root).as_posix()))
        else:
            # The file itself may be replaced.
            self._watch(root.parent, lambda path: path.name == root.name, recursive=False)

    def _watch(
        self, root: Path, matters: Callable[[Path], bool], *, recursive: bool = True
    ) -> None:
        def concerns(_: Change, path: str) -> bool:
            return not Path(path).is_relative_to(self._report) and matters(Path(path))

        while not self._stop.is_set():
            watched = _identity(root)
            if watched is None:
                self._stop.wait(_LOOK_MS / 1000)
                continue
            # What was there before the watch began may be new.
            self._news.put(None)
            with contextlib.suppress(FileNotFoundError):
                for changes in watch(
                    root,
                    watch_filter=concerns,
                    debounce=_LONGEST_MS,
                    step=_SETTLED_MS,
                    stop_event=self._stop,
                    recursive=recursive,
                    raise_interrupt=False,
                    rust_timeout=_LOOK_MS,
                    yield_on_timeout=True,
                ):
                    if changes:
                        self._news.put(None)
                    # If the folder was removed and made again, the new one is not watched yet.
                    if _identity(root) != watched:
                        break


def _identity(folder: Path) -> tuple[int, int] | None:
    """Which folder is at a path now, or None without one."""
    with contextlib.suppress(OSError):
        status = folder.stat()
        return status.st_dev, status.st_ino
    return None


def _ended(grading: Future[Graded]) -> Ended:
    try:
        return Ended(grading.result())
    except RosgradeError as problem:
        return Ended(problem=problem)
