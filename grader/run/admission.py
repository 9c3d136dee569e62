"""How many cells may run, and how many of them may be starting, at the same time.

Starting a node costs nearly all of its CPU time, and many starts at one instant disturb the timing
of those that already run; so starts are counted separately. Beyond a few, another cell is let in
only while the machine has a CPU and memory to spare.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

from grader.machine.load import Load, cpu_count
from grader.sandbox.limits import raise_open_files

_CELLS_PER_CPU = 24
"""At 16, one second of the first five of a class passed with both CPUs half idle."""
_STARTS_PER_CPU = 3.0
"""More than one, because a start also waits: for processes, and for DDS to discover them."""
_BUSY_PER_CPU = 6.0
"""Runnable threads for each CPU of the machine from which on no cell is let in."""
_FREE_MEMORY = 0.125
"""Share of the memory that stays free; a cell of the course takes some 40 MB."""
_LONGEST_START_S = 2.0
"""A node without a match by then waits for something, and takes no CPU any more."""
_LOOK_AGAIN_S = 0.05


class Admission:
    """Admits cells; shared by all runs of this process."""

    def __init__(
        self, cells: int | None = None, starts: int | None = None, load: Load | None = None
    ) -> None:
        """Set the bounds.

        Args:
            cells: Most cells at once; by default the load decides.
            starts: Most cells that start at once; by default three for each CPU.
        """
        cpus = cpu_count()
        raise_open_files()
        self.most = cells if cells is not None else _CELLS_PER_CPU * cpus
        self._always = self.most if cells is not None else cpus
        self._starts = starts if starts is not None else math.ceil(_STARTS_PER_CPU * cpus)
        self._busy = _BUSY_PER_CPU * cpus
        self._load = load or Load()
        self._running: dict[Ticket, float] = {}
        self._queue: deque[Ticket] = deque()
        self._alone = False
        self.changed = threading.Condition()

    @contextmanager
    def cell(self, *, alone: bool = False) -> Iterator[Ticket]:
        """Wait for a place, first come, first served; a cell that must be ``alone`` goes first."""
        ticket = Ticket(self)
        with self.changed:
            (self._queue.appendleft if alone else self._queue.append)(ticket)
            try:
                # Only the first one looks at the load, to which all the others would add.
                while self._queue[0] is not ticket or not self._is_free(alone):
                    is_first = self._queue[0] is ticket
                    self.changed.wait(_LOOK_AGAIN_S if is_first else None)
                self._running[ticket] = time.monotonic()
                self._alone = alone
            finally:
                self._queue.remove(ticket)
                self.changed.notify_all()
        try:
            yield ticket
        finally:
            with self.changed:
                del self._running[ticket]
                self._alone = self._alone and not alone
                self.changed.notify_all()

    def _is_free(self, alone: bool) -> bool:
        running = len(self._running)
        if alone:
            return running == 0
        since_s = time.monotonic() - _LONGEST_START_S
        starting = sum(
            ticket.is_starting and began_s > since_s for ticket, began_s in self._running.items()
        )
        if self._alone or running >= self.most or starting >= self._starts:
            return False
        if running < self._always:
            return True
        return self._load.runnable() < self._busy and self._load.free_memory() > _FREE_MEMORY


class Ticket:
    """The place of one cell."""

    def __init__(self, admission: Admission) -> None:
        self._admission = admission
        self.is_starting = True

    def started(self) -> None:
        """The cell has started: another one may."""
        if self.is_starting:
            self.is_starting = False
            with self._admission.changed:
                self._admission.changed.notify_all()
