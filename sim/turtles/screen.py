"""What turtles show in a terminal: where each is, in a line or in a live view."""

from __future__ import annotations

import math
from typing import Any

from rich.text import Text

from sim.motion import NS
from sim.pacing import Lateness
from sim.turtles.simulation import State, Step


class TurtleScreen:
    """What is shown; receives the truth from the simulation as its sink."""

    def __init__(self) -> None:
        """Begin with nothing to show."""
        self._step: Step | None = None
        self._late_steps = 0

    @property
    def time_ns(self) -> int:
        """Simulated time of what is shown."""
        return self._step.time_ns if self._step else 0

    def on_step(self, step: Step, stamp_ns: int) -> None:
        """Keep the newest step."""
        self._step = step

    def on_late(self, lateness: Lateness) -> None:
        """Count late steps."""
        self._late_steps += lateness.steps

    def on_answer(self, request: Any, response: Any) -> None:
        """Requests are not shown."""

    def line(self) -> str:
        """Everything in one line."""
        return "  ".join(self._parts())

    def picture(self, columns: int, lines: int) -> Text:
        """The live view, a turtle in each line."""
        return Text("\n".join((*self._parts(), "Ctrl-C ends"))[: columns * lines])

    def _parts(self) -> list[str]:
        if self._step is None:
            return ["starting"]
        late = [f"{self._late_steps} steps late"] if self._late_steps else []
        turtles = (_words(name, state) for name, state in self._step.turtles.items())
        return [f"{self._step.time_ns / NS:8.2f} s", *turtles, *late]


def _words(name: str, state: State) -> str:
    pose, wall = state.pose, " at a wall" if state.hits_wall else ""
    degrees = math.degrees(pose.yaw_rad)
    return f"{name} x {pose.x_m:.2f} m y {pose.y_m:.2f} m theta {degrees:+.0f} deg{wall}"
