"""How many cells may run, and how many of them may be starting, at the same time.

Starting a node costs nearly all of its CPU time (imports, DDS), and many starts at one
instant disturb the timing of those that already run; so starts are counted apart. Beyond a
few, another cell is let in only while the machine, with all that others do on it, has a CPU
to spare.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from grader.run.load import Load, cpu_count

_CELLS_PER_CPU = 16
_BUSY_PER_CPU = 2.5
"""Runnable threads of the machine for each CPU from which on nobody more is let in."""
_LONGEST_START_S = 2.0
"""What has not matched by then waits for something, and costs no CPU any more."""
_LOOK_AGAIN_S = 0.05


class Admission:
    """Admits cells; shared by everything that runs in one process of ours."""

    def __init__(
        self, cells: int | None = None, starts: int | None = None, load: Load | None = None
    ) -> None:
        """Set the bounds.

        Args:
            cells: Most cells at once, whatever the load; by default the load decides.
            starts: Most cells that start at once; by default one for each CPU.
            load: Of the machine.
        """
        cpus = cpu_count()
        self.most = cells if cells is not None else _CELLS_PER_CPU * cpus
        self._always = self.most if cells is not None else cpus
        self._starts = starts if starts is not None else cpus
        self._busy = _BUSY_PER_CPU * cpus
        self._load = load or Load()
        self._running: dict[Ticket, float] = {}
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
            with self._changed:
                del self._running[ticket]
                self._alone = self._alone and not alone
                self._changed.notify_all()

    def _enter(self, alone: bool) -> Ticket:
        ticket = Ticket(self)
        with self._changed:
            self._waiting_alone += alone
            try:
                while not self._is_free(alone):
                    self._changed.wait(_LOOK_AGAIN_S)
            finally:
                self._waiting_alone -= alone
            self._running[ticket] = time.monotonic()
            self._alone = alone
        return ticket

    def _is_free(self, alone: bool) -> bool:
        running = len(self._running)
        if alone:
            return running == 0
        if self._alone or self._waiting_alone or running >= self.most:
            return False
        if self._starting() >= self._starts:
            return False
        return running < self._always or self._load.runnable() < self._busy

    def _starting(self) -> int:
        since_s = time.monotonic() - _LONGEST_START_S
        return sum(
            ticket.is_starting and began_s > since_s for ticket, began_s in self._running.items()
        )

    def _note_started(self) -> None:
        with self._changed:
            self._changed.notify_all()


class Ticket:
    """The place of one cell.

    Attributes:
        is_starting: Whether it has not got to where only its timers cost CPU time.
    """

    def __init__(self, admission: Admission) -> None:
        """Made by :meth:`Admission.cell` only."""
        self._admission = admission
        self.is_starting = True

    def started(self) -> None:
        """The cell has started: another one may."""
        if self.is_starting:
            self.is_starting = False
            self._admission._note_started()
