"""When a run may end: the ``until`` of a scenario, and processes that wait to exit."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

from grader.recording.model import NS, Owner
from grader.run.cell.graph import GraphObserver
from grader.run.host.stopwatch import Stopwatch
from grader.run.order import UntilOrder
from grader.run.process.output import OutputReader
from grader.run.process.student import StudentProcesses

if TYPE_CHECKING:
    from grader.run.cell.probe import Probe
    from grader.run.cell.simulated import Moving
    from grader.run.stimuli.player import Player

_AFTER_CONTACT_S = 1.0


class EndingConditions:
    """Looks at what has been observed so far."""

    def __init__(
        self,
        probe: Probe,
        output: OutputReader,
        moving: Iterable[Moving],
        player: Player,
    ) -> None:
        self._player = player
        self._probe = probe
        self._output = output
        self._moving = tuple(moving)

    def is_over(self) -> bool:
        """Whether a robot has touched something: no verdict can change any more."""
        return any(one.in_contact_s > _AFTER_CONTACT_S for one in self._moving)

    def met(self, until: UntilOrder, watch: Stopwatch) -> bool:
        """Whether everything that an ``until`` names holds; one without conditions is never met."""
        conditions = []
        if until.messages is not None:
            conditions.append(all(n >= until.messages for n in self._probe.counts.values()))
        if until.quiet_s is not None:
            conditions.append(self._quiet_s(watch) >= self._longest_quiet_s(until.quiet_s))
        if until.elapsed_s is not None:
            conditions.append(watch.elapsed_s >= until.elapsed_s)
        for one in self._moving:
            if until.at_rest_s is not None:
                conditions.append(one.at_rest_s >= until.at_rest_s)
            if until.travelled_m is not None:
                conditions.append(one.travelled_m >= until.travelled_m)
        if until.stimuli_done:
            conditions.append(self._player.is_done)
        if until.any:
            conditions.append(any(self.met(item, watch) for item in until.any))
        return bool(conditions) and all(conditions)

    def _quiet_s(self, watch: Stopwatch) -> float:
        """Time since the last message of the student, or of the probe, which may be answered."""
        last_ns = max(self._probe.last_message_ns or 0, self._player.last_ns or 0)
        return min(watch.elapsed_s, (time.time_ns() - last_ns) / NS)

    def _longest_quiet_s(self, quiet_s: float) -> float:
        """The wanted silence, or more where a declared timer may fire later."""
        periods = [
            float(item.data["period_s"])
            for item in self._output.declarations
            if item.kind == "timer" and isinstance(item.data.get("period_s"), int | float)
        ]
        return max([quiet_s, *(1.2 * period + 0.2 for period in periods)])


class ExitBarrier:
    """Keeps processes from exiting until everything that they declared was seen in the graph."""

    def __init__(
        self, output: OutputReader, graph: GraphObserver, students: StudentProcesses
    ) -> None:
        self._output = output
        self._graph = graph
        self._students = students
        self._given = 0

    @property
    def is_asked(self) -> bool:
        """Whether a process waits for the permission to exit."""
        return len(self._waiting()) > self._given

    def give(self) -> None:
        """Let processes exit if everything that they declared is in the graph."""
        if self.is_asked and self._all_seen():
            waiting = self._waiting()
            for name in waiting[self._given :]:
                self._students.let_exit(name)
            self._given = len(waiting)

    def _waiting(self) -> list[str]:
        return [item.process for item in self._output.declarations if item.kind == "leaving"]

    def _all_seen(self) -> bool:
        seen = {("node", node.name) for node in self._graph.nodes}
        seen |= {
            (endpoint.kind.value, endpoint.topic)
            for endpoint in self._graph.endpoints
            if endpoint.owner is not Owner.PROBE
        }
        names = {"node": "node", "publisher": "topic", "subscription": "topic"}
        return all(
            (item.kind, str(item.data.get(names[item.kind]))) in seen
            for item in self._output.declarations
            if item.kind in names
        )
