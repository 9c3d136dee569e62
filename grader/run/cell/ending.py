"""When an observation may end early: the ``until`` of a scenario, as things stand."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from grader.recording.model import NS
from grader.run.host.stopwatch import Stopwatch
from grader.run.order import Until
from grader.run.process.output import OutputReader

if TYPE_CHECKING:
    from grader.run.cell.probe import Probe
    from grader.run.cell.simulator import SimulatedRobot
    from grader.run.stimuli.player import Player

_AFTER_CONTACT_S = 1.0


class EndingConditions:
    """Looks at what has been observed so far."""

    def __init__(
        self,
        probe: Probe,
        output: OutputReader,
        robot: SimulatedRobot | None,
        player: Player,
    ) -> None:
        """Keep what to look at.

        Args:
            robot: The simulated robot, or None.
        """
        self._player = player
        self._probe = probe
        self._output = output
        self._robot = robot

    def is_over(self) -> bool:
        """Whether the robot has touched something: no verdict can change any more."""
        return self._robot is not None and self._robot.in_contact_s > _AFTER_CONTACT_S

    def met(self, until: Until, watch: Stopwatch) -> bool:
        """Whether everything that an ``until`` names holds.

        Args:
            until: What is asked for; nothing asked for is never met.
        """
        conditions = []
        if until.messages is not None:
            conditions.append(all(n >= until.messages for n in self._probe.counts.values()))
        if until.quiet_s is not None:
            conditions.append(self._quiet_s(watch) >= self._longest_silence_s(until.quiet_s))
        if until.elapsed_s is not None:
            conditions.append(watch.elapsed_s >= until.elapsed_s)
        if until.at_rest_s is not None and self._robot is not None:
            conditions.append(self._robot.at_rest_s >= until.at_rest_s)
        if until.travelled_m is not None and self._robot is not None:
            conditions.append(self._robot.travelled_m >= until.travelled_m)
        if until.stimuli_done:
            conditions.append(self._player.is_done)
        if until.any:
            conditions.append(any(self.met(item, watch) for item in until.any))
        return bool(conditions) and all(conditions)

    def _quiet_s(self, watch: Stopwatch) -> float:
        """Since the last message of the student's, and of ours, to which one may be the answer."""
        last_ns = max(self._probe.last_message_ns or 0, self._player.last_ns or 0)
        return min(watch.elapsed_s, (time.time_ns() - last_ns) / NS)

    def _longest_silence_s(self, quiet_s: float) -> float:
        """How long silence must last: a timer that has not fired yet may still publish."""
        periods = [
            float(item.data["period_s"])
            for item in self._output.declarations
            if item.kind == "timer" and isinstance(item.data.get("period_s"), int | float)
        ]
        return max([quiet_s, *(1.2 * period + 0.2 for period in periods)])
