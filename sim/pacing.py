"""Real time in fixed steps: which steps are due, and how late they are. Pure; no clock."""

from __future__ import annotations

from dataclasses import dataclass

from sim.simulation import STEP_NS

LATE_NS = 5_000_000
"""Being so far behind, which is half a step of a robot, is reported."""

MAX_BATCH = 100
"""Most steps that are caught up at once, so that the loop can be ended in between."""

MAX_AHEAD = 10
"""Most steps that are done together where no difference can be seen."""


@dataclass(frozen=True, slots=True)
class Lateness:
    """Steps that are late because of the host."""

    index: int
    steps: int
    late_ns: int

    def __str__(self) -> str:
        """Say it in words."""
        return f"{self.steps} steps done {self.late_ns / 1e6:.0f} ms late"


class Pacer:
    """Compares done steps with a clock: none is left out, and none is done before its end."""

    def __init__(self, begin_ns: int, step_ns: int = STEP_NS) -> None:
        """Begin at a time of the steady clock."""
        self.begin_ns = begin_ns
        self._step_ns = step_ns
        self.done = 0
        self._planned = 1

    @property
    def deadline_ns(self) -> int:
        """When the planned step is to be done, on the steady clock."""
        return self.begin_ns + self._planned * self._step_ns

    def due(self, now_ns: int) -> int:
        """How many steps are over and not yet done, at most :data:`MAX_BATCH`."""
        return max(0, min((now_ns - self.begin_ns) // self._step_ns - self.done, MAX_BATCH))

    def lateness(self, now_ns: int) -> Lateness | None:
        """What is to be reported before the steps that are due are done, if anything."""
        behind_ns = now_ns - self.deadline_ns
        if behind_ns <= LATE_NS:
            return None
        return Lateness(self.done + 1, self.due(now_ns), behind_ns)

    def plan(self, output_ns: int | None) -> int:
        """Choose when to look again.

        Args:
            output_ns: Simulated time of the next step that is published, or None.

        Returns:
            The new :attr:`deadline_ns`: that of this step, but at most :data:`MAX_AHEAD`
            steps from here.
        """
        most = self.done + MAX_AHEAD
        wanted = most if output_ns is None else min(output_ns // self._step_ns, most)
        self._planned = max(self.done + 1, wanted)
        return self.deadline_ns
