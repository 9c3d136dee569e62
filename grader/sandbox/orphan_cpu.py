"""CPU time that processes take along when they end, since nobody waits for them.

What a process took is added to its parent's when the parent has waited for it, and to nobody's if
the parent ignores SIGCHLD (wait(2), "ERRORS"): one that starts others without end would take
nothing, however busy they keep the CPUs. So what each of them had when it was seen last is kept.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

_WINDOW = 3
"""Looks within which a parent has got what the child had that is missing at the last of them.

Processes are read one after the other: it may have been read at any time since its child was seen
last. One that is missing once may have ended after its parent was read; twice it is certain.
"""


class Process(NamedTuple):
    """What tells a process from a later one with its number."""

    pid: int
    started: int


class Taken(NamedTuple):
    """CPU time of a process in ticks, as proc(5) tells it.

    Attributes:
        waited: Of the children that it has waited for, and of those that they have.
    """

    own: int
    waited: int


class OrphanCpu:
    """Keeps an account of processes that are looked at again and again.

    All of it is a lower bound: what a process took since it was seen last is not known, nor
    anything of one that was never seen.

    Attributes:
        ended: How many processes have ended since the look before, if any of them was not waited
            for; else 0.
    """

    def __init__(self) -> None:
        """Nothing was seen yet."""
        self.ticks = 0
        self.ended = 0
        self._there: dict[Process, Taken] = {}
        self._missing: dict[Process, Taken] = {}
        self._gained: deque[int] = deque(maxlen=_WINDOW)

    def look(self, there: Mapping[Process, Taken], *, complete: bool = False) -> None:
        """Note what is there now.

        Args:
            complete: That none ended between the moment when all were listed and when it was
                to be read itself. Whoever is missing has ended for certain then.
        """
        before = {**self._missing, **self._there}
        self._gained.append(
            sum(
                taken.waited - (before[one].waited if one in before else 0)
                for one, taken in there.items()
            )
        )
        missing = {one: taken for one, taken in before.items() if one not in there}
        ended = [taken for one, taken in missing.items() if complete or one in self._missing]
        lost = sum(taken.own + taken.waited for taken in ended)
        for age, gained in enumerate(self._gained):
            found = min(lost, gained)
            self._gained[age] -= found
            lost -= found
        self.ticks += lost
        self.ended = len(ended) if lost else 0
        self._missing = {
            one: taken for one, taken in missing.items() if one in self._there and not complete
        }
        self._there = dict(there)
