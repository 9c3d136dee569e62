"""A judging of the whole class in the background: a preview, or a regrade that is written."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field

from grader.assignment.load import LoadedAssignment
from grader.batch.class_regrading import Regraded, regrade_class, write_regraded
from grader.batch.ledger import Ledger
from grader.errors import RosgradeError, UsageError


@dataclass
class Regrading:
    """At most one judging at a time, and what came of the last one."""

    ledger: Ledger
    writing: threading.Lock
    title: str = ""
    check: str = ""
    total: int = 0
    rows: list[Regraded] = field(default_factory=list)
    problem: str = ""
    _thread: threading.Thread | None = None

    @property
    def running(self) -> bool:
        """Whether one goes on."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def changed(self) -> list[Regraded]:
        """The rows that are judged otherwise."""
        return [row for row in self.rows if row.changes or row.problem]

    def start(
        self,
        title: str,
        check: str,
        load: Callable[[], LoadedAssignment],
        *,
        write: bool,
        then: Callable[[], None] = lambda: None,
    ) -> None:
        """Begin; ``load`` makes the assignment to judge with, and ``then`` is called at the end."""
        if self.running:
            raise UsageError("The class is being judged. Wait until that has ended.")
        self.title, self.check, self.rows, self.problem = title, check, [], ""
        self.total = len(self.ledger.read().entries)

        def work() -> None:
            try:
                with self.writing, self.ledger.opened() if write else nullcontext():
                    loaded = load()
                    for row in regrade_class(loaded, self.ledger, write=write):
                        self.rows.append(row)
                    if write:
                        write_regraded(self.rows, self.ledger)
            except RosgradeError as error:
                self.problem = str(error)
            except Exception as error:
                # A check of the assignment's own may raise anything; the server goes on.
                self.problem = f"{type(error).__name__}: {error}"
            then()

        self._thread = threading.Thread(target=work, daemon=True, name="regrade")
        self._thread.start()
