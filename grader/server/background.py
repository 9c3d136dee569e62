"""What a review does in the background, one thing at a time: write reports, judge, run again."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, field

from grader.assignment.load import LoadedAssignment
from grader.errors import RosgradeError
from grader.gradebook.class_files import all_standing, write_class
from grader.gradebook.class_regrading import (
    Regraded,
    bring_up_to_date,
    regrade_class,
    write_regraded,
)
from grader.server.reviewed_class import ReviewedClass

_NOT_RUN = "the batch ended, and its result is the one of before"


@dataclass
class Judging:
    """A judging of the whole class: a preview, or a regrade that is written."""

    title: str = ""
    check: str = ""
    total: int = 0
    running: bool = False
    rows: list[Regraded] = field(default_factory=list)
    problem: str = ""

    @property
    def changed(self) -> list[Regraded]:
        """The rows that are judged otherwise."""
        return [row for row in self.rows if row.changes or row.problem]


@dataclass
class Again:
    """A submission that is run again; what is wrong if it cannot be."""

    key: str
    running: bool = True
    problem: str = ""


class Background:
    """One thread for a class."""

    def __init__(self, reviewed: ReviewedClass) -> None:
        """Begin: read the class, and write what was changed before."""
        self.judging = Judging()
        self.problem = ""
        """Why reports and gradebook are not up to date; empty if they are, or soon will be."""
        self._ledger = reviewed.ledger
        self._worker = ThreadPoolExecutor(1, "background")
        self._next: Future[None] | None = None
        self._ended = False
        self.again: dict[str, Again] = {}
        """What is run again, by its key, until the page has asked how that ended."""
        self._batch: subprocess.Popen[str] | None = None
        self._worker.submit(reviewed.rows)
        self.refresh()

    def refresh(self) -> None:
        """Write the reports, the gradebook and the overview again, as far as they changed."""
        if self._next is not None:
            # One that has not begun is as good as a new one.
            self._next.cancel()
        self._next = self._worker.submit(self._refresh)

    def judge(self, title: str, check: str, loaded: LoadedAssignment, *, write: bool) -> None:
        """Judge the class with an assignment; the page asks how far that is."""
        total = len(self._ledger.read().entries)
        self.judging = Judging(title, check, total, running=True)
        self._worker.submit(self._judge, self.judging, loaded, write)

    def run_again(self, key: str) -> None:
        """Run a submission again, as ``rosgrade batch OUT --retry KEY`` does."""
        if key not in self.again or not self.again[key].running:
            self.again[key] = Again(key)
            self._worker.submit(self._run_again, self.again[key])

    def close(self) -> None:
        """End, when all that was begun is written; a batch ends as by Ctrl-C."""
        self._ended = True
        if self._batch is not None:
            self._batch.terminate()
        self._worker.shutdown()

    def _refresh(self) -> None:
        try:
            with self._ledger.opened() as ledger:
                write_class(bring_up_to_date(all_standing(ledger), ledger), ledger)
            self.problem = ""
        except Exception as error:
            # Also that of a check of the assignment's own; what was written down is safe.
            self.problem = f"The reports are not up to date: {_words(error)}"

    def _run_again(self, again: Again) -> None:
        try:
            before = self._ledger.result(again.key)
            errors = "" if self._ended else self._batch_again(again.key)
            # Its exit code is also that of other submissions, and of a machine without a sandbox.
            after = self._ledger.result(again.key)
            if after is None or (before is not None and after.started == before.started):
                again.problem = errors.strip().removeprefix("rosgrade: error: ") or _NOT_RUN
        except Exception as error:
            again.problem = _words(error)
        again.running = False

    def _batch_again(self, key: str) -> str:
        """Run it; what the batch says of what is wrong."""
        command = [sys.executable, "-m", "grader", "batch", str(self._ledger.out.resolve())]
        self._batch = subprocess.Popen(
            [*command, "--retry", key, "--quiet"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        return self._batch.communicate()[1]

    def _judge(self, judging: Judging, loaded: LoadedAssignment, write: bool) -> None:
        try:
            with self._ledger.opened() if write else nullcontext():
                for row in regrade_class(loaded, self._ledger, write=write):
                    judging.rows.append(row)
                    if self._ended and not write:
                        break
                if write:
                    write_regraded(judging.rows, self._ledger)
        except Exception as error:
            judging.problem = _words(error)
        judging.running = False


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, RosgradeError) else f"{type(error).__name__}: {error}"
