"""CPU time of processes that end without their parent waiting for them.

What a process took is added to its parent's when the parent has waited for it, and to none if the
parent ignores SIGCHLD (wait(2), "ERRORS"). So what each of them had when it was seen last is kept.
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
    """CPU time of a process in ticks, and that of the children that it has waited for: proc(5)."""

    own: int
    waited: int


class OrphanCpu:
    """Keeps an account of processes that are looked at again and again; a lower bound.

    Attributes:
        ended: How many processes have ended since the look before, if any was not waited for.
    """

    def __init__(self) -> None:
        self.ticks = 0
        self.ended = 0
        self._there: dict[Process, Taken] = {}
        self._missing: dict[Process, Taken] = {}
        self._gained: deque[int] = deque(maxlen=_WINDOW)

    def look(self, there: Mapping[Process, Taken], *, complete: bool = False) -> None:
        """Note what is there now.

        Args:
            complete: None ended while they were read: one that is missing has ended for certain.
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
