"""Real time in fixed steps: which steps are due, and how late they are. Pure; no clock."""

from __future__ import annotations

from dataclasses import dataclass

from sim.simulation import STEP_NS

LATE_NS = 5_000_000
"""A step that is done more than half a step after its time is reported as late."""

MAX_BATCH = 100
"""So many steps are caught up at once at most, so that whoever owns the loop can end it."""


@dataclass(frozen=True, slots=True)
class Lateness:
    """Steps that the host did not let us do in time.

    Attributes:
        index: First of them (see :attr:`sim.simulation.Step.index`).
        steps: How many were done at once.
        late_ns: How late the first one was.
    """

    index: int
    steps: int
    late_ns: int


class Pacer:
    """Compares done steps with a clock.

    Step ``k`` (from 1) ends ``k`` steps after the beginning and is done at that time. No step
    is ever left out: simulated time is what it says, to the step.
    """

    def __init__(self, begin_ns: int) -> None:
        """Begin.

        Args:
            begin_ns: Reading of a steady clock at simulated time 0.
        """
        self._begin_ns = begin_ns
        self._done = 0

    @property
    def deadline_ns(self) -> int:
        """When the next step is to be done, on the steady clock."""
        return self._begin_ns + (self._done + 1) * STEP_NS

    def due(self, now_ns: int) -> int:
        """How many steps are to be done now, at most :data:`MAX_BATCH`."""
        return max(0, min((now_ns - self._begin_ns) // STEP_NS - self._done, MAX_BATCH))

    def lateness(self, now_ns: int, late_ns: int = LATE_NS) -> Lateness | None:
        """What is to be reported before the steps that are due are done, if anything."""
        behind_ns = now_ns - self.deadline_ns
        if behind_ns <= late_ns:
            return None
        return Lateness(self._done + 1, self.due(now_ns), behind_ns)

    def done(self) -> None:
        """Count a step."""
        self._done += 1
