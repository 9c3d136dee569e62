"""Reports, gradebook and overview are written again after each change, in the background."""

from __future__ import annotations

import threading

from grader.batch.class_files import standing, write_class
from grader.batch.ledger import Ledger
from grader.batch.rendering import bring_up_to_date
from grader.errors import RosgradeError


class Refreshing:
    """A thread that brings the files of a class up to date when something was changed."""

    def __init__(self, ledger: Ledger, writing: threading.Lock) -> None:
        """Begin, at once with what was changed before; ``writing`` is held while it writes."""
        self.problem = ""
        """Why the files are not up to date; empty if they are, or soon will be."""
        self._ledger = ledger
        self._writing = writing
        self._changed = threading.Event()
        self._ended = False
        self.poke()
        self._thread = threading.Thread(target=self._work, daemon=True, name="refresh")
        self._thread.start()

    def poke(self) -> None:
        """Say that something was changed."""
        self._changed.set()

    def close(self) -> None:
        """End, when what was changed is written."""
        self._ended = True
        self.poke()
        self._thread.join()

    def _work(self) -> None:
        while not self._ended:
            self._changed.wait()
            self._changed.clear()
            try:
                with self._writing, self._ledger.opened() as ledger:
                    rows = [standing(ledger, entry) for entry in ledger.read().entries]
                    write_class(bring_up_to_date(rows, ledger), ledger)
                self.problem = ""
            except (RosgradeError, OSError) as error:
                self.problem = str(error)
