"""Who was caught, when, and how near the hunter was."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter

from grader.recording.model import Recording
from grader.recording.simulated import Truth, TurtleEvent


@dataclass(frozen=True)
class Catch:
    """A turtle that was killed.

    Attributes:
        distance_m: How far the hunter was from it; None if one of them was not there before.
        nearest: The one that was the nearest when the hunt for it began, and how far it was.
        begin_m: How far this one was then.
    """

    name: str
    time_ns: int
    distance_m: float | None
    nearest: tuple[str, float] | None
    begin_m: float | None


@dataclass(frozen=True)
class Hunt:
    """A hunter and its prey."""

    recording: Recording
    hunter: str
    prey: tuple[str, ...]

    @cached_property
    def ways(self) -> dict[str, list[Truth]]:
        """The truth of each turtle."""
        found: dict[str, list[Truth]] = {}
        for step in self.recording.truth:
            found.setdefault(step.robot, []).append(step)
        return found

    @cached_property
    def killed(self) -> tuple[TurtleEvent, ...]:
        """When prey was killed, in order; who is spawned and killed again counts once."""
        first: dict[str, TurtleEvent] = {}
        for event in self.recording.turtles:
            if event.kind == "killed" and event.turtle in self.prey:
                first.setdefault(event.turtle, event)
        return tuple(first.values())

    def distance_m(self, name: str, time_ns: int) -> float | None:
        """How far a turtle was from the hunter at the end of the last step before a time."""
        hunter, prey = self._at(self.hunter, time_ns), self._at(name, time_ns)
        if hunter is None or prey is None:
            return None
        return math.hypot(prey.x_m - hunter.x_m, prey.y_m - hunter.y_m)

    def _at(self, name: str, time_ns: int) -> Truth | None:
        way = self.ways.get(name, [])
        index = bisect_right(way, time_ns - 1, key=attrgetter("time_ns"))
        return way[index - 1] if index else None

    @cached_property
    def catches(self) -> tuple[Catch, ...]:
        """What was caught, in order."""
        # The first hunt begins when all prey is there; who waits for it chooses then.
        first_ns = [self.ways[name][0].time_ns for name in self.prey if name in self.ways]
        begin_ns = max(first_ns, default=0) + 1
        alive = sorted(set(self.prey))
        caught = []
        for event in self.killed:
            name = event.turtle
            begin_ns = min(begin_ns, event.time_ns)
            distances_m = {other: self.distance_m(other, begin_ns) for other in alive}
            known_m = {other: one for other, one in distances_m.items() if one is not None}
            nearest = min(known_m.items(), key=lambda pair: pair[1], default=None)
            at_end_m = self.distance_m(name, event.time_ns)
            caught.append(Catch(name, event.time_ns, at_end_m, nearest, known_m.get(name)))
            alive.remove(name)
            begin_ns = event.time_ns
        return tuple(caught)
