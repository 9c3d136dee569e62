"""How many cells may run, and how many of them may be starting, at the same time.

Starting a node costs nearly all of its CPU time (imports, DDS), and many starts at one
instant disturb the timing of those that already run; so starts are counted apart.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager


def cpu_count() -> int:
    """CPUs that this process may use."""
    return len(os.sched_getaffinity(0))


class Admission:
    """Admits cells; shared by everything that runs in one process of ours."""

    def __init__(self, cells: int | None = None, starts: int | None = None) -> None:
        """Set the bounds.

        Args:
            cells: Most cells at once; by default four for each CPU.
            starts: Most cells that start at once; by default one for each CPU.
        """
        cpus = cpu_count()
        self._cells = cells if cells is not None else 4 * cpus
        self._starts = starts if starts is not None else cpus
        self._running = 0
        self._starting = 0
        self._alone = False
        self._waiting_alone = 0
        self._changed = threading.Condition()

    @contextmanager
    def cell(self, *, alone: bool = False) -> Iterator[Ticket]:
        """Wait for a place.

        Args:
            alone: Wait until no other cell runs, and let none start meanwhile.
        """
        ticket = self._enter(alone)
        try:
            yield ticket
        finally:
            ticket.started()
            with self._changed:
                self._running -= 1
                self._alone = self._alone and not alone
                self._changed.notify_all()

    def _enter(self, alone: bool) -> Ticket:
        with self._changed:
            self._waiting_alone += alone
            self._changed.wait_for(lambda: self._is_free(alone))
            self._waiting_alone -= alone
            self._running += 1
            self._starting += 1
            self._alone = alone
        return Ticket(self)

    def _is_free(self, alone: bool) -> bool:
        if alone:
            return self._running == 0
        return (
            not self._alone
            and not self._waiting_alone
            and self._running < self._cells
            and self._starting < self._starts
        )

    def _note_started(self) -> None:
        with self._changed:
            self._starting -= 1
            self._changed.notify_all()


class Ticket:
    """The place of one cell."""

    def __init__(self, admission: Admission) -> None:
        """Made by :meth:`Admission.cell` only."""
        self._admission = admission
        self._is_starting = True

    def started(self) -> None:
        """The cell has started: another one may."""
        if self._is_starting:
            self._is_starting = False
            self._admission._note_started()
