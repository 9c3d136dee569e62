"""Programs of the author's that run beside the student's: another robot, or a simulator."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from grader.recording.model import NS, Owner
from grader.run.cell.graph import GraphObserver
from grader.run.host.disturbance import DisturbanceMeter
from grader.run.host.stopwatch import Stopwatch
from grader.run.order import CellOrder
from grader.run.process.output import OutputReader
from grader.run.process.student import StudentProcesses
from grader.spec.unit import format_duration

if TYPE_CHECKING:
    from grader.run.cell.author_simulator import AuthorSimulator

_PIPES_LIMIT_S = 1.0
_SHOWN_LINES = 3
_SETTLED_S = 1.0
"""Nodes of a launch file come one after the other; what comes later would be the student's."""


class Companions:
    """They are started and stopped as the student's are, and nothing of theirs is judged.

    In a sandbox they run in the trusted part of the cell.
    """

    def __init__(
        self,
        order: CellOrder,
        meter: DisturbanceMeter,
        graph: GraphObserver,
        simulator: AuthorSimulator | None = None,
    ) -> None:
        self._order, self._meter = order, meter
        self._graph = graph
        self._simulator = simulator
        self._output = OutputReader(order.limits.output_bytes)
        self._processes = StudentProcesses(self._output, meter)
        self._has_files = any(one.is_launch_file for one in order.companions)
        self._started: Stopwatch | None = None

    @property
    def pids(self) -> frozenset[int]:
        """Every process of theirs."""
        return self._processes.pids

    def start(self, domain_id: int) -> None:
        """Start them; what is new in the graph is theirs until they are ready."""
        self._graph.newcomers = Owner.COMPANION
        self._started = Stopwatch(self._meter)
        of_run = {"ROS_DOMAIN_ID": str(domain_id)}
        environment, folder = self._order.companion_environment, Path(self._order.scratch)
        for one in self._order.companions:
            self._processes.launch(one.name, one.argv, environment, of_run, folder)

    def are_ready(self) -> bool:
        """Whether all that is theirs is there; what is new in the graph then is the student's."""
        if self._lacking() is not None:
            return False
        if self._has_files and time.time_ns() - self._graph.changed_ns < _SETTLED_S * NS:
            return False
        self._processes.refresh()
        self._graph.newcomers = Owner.STUDENT
        self._started = None
        if self._simulator is not None:
            self._simulator.begin()
        return True

    def faults(self) -> list[str]:
        """A sentence for each that ended by an error, that is not ready in time, or is silent."""
        self._processes.poll()
        found = []
        for one in self._processes.records():
            simulates = self._simulator is not None and one.name == self._simulator.name
            if one.exited_ns is not None and (one.exit_code or simulates):
                what = "simulator" if simulates else "companion"
                found.append(
                    f"the {what} {one.name} of the assignment ended with exit code "
                    f"{one.exit_code}: {self._said(one.name)}"
                )
        if self._simulator is not None and not found:
            self._simulator.look()
            found += self._simulator.faults()
        simulator = self._simulator
        limit_s = self._order.limits.discovery_s if simulator is None else simulator.within_s
        if self._started is not None and self._started.elapsed_s > limit_s and not found:
            why = self._lacking() or "new nodes come all the time"
            names = ", ".join(one.name for one in self._order.companions)
            last = self._said(self._order.companions[0].name)
            found.append(
                f"the programs of the assignment ({names}) were not ready within "
                f"{format_duration(limit_s)}: {why}. The first of them printed last: {last}"
            )
        return found

    def stop(self) -> list[str]:
        """End them; what went wrong before."""
        found = self.faults()
        self._processes.stop(self._order.limits)
        return found

    def clean_up(self) -> None:
        """Take what is left of them."""
        self._processes.clean_up()
        self._output.close(_PIPES_LIMIT_S)

    def _lacking(self) -> str | None:
        nodes = [one for one in self._graph.nodes if one.owner is Owner.COMPANION]
        if len(nodes) < len(self._order.companions):
            return "they have not one node each"
        return self._simulator.lacks() if self._simulator is not None else None

    def _said(self, name: str) -> str:
        said = " ".join(self._output.tail(name, "stderr", _SHOWN_LINES))
        return said or "it printed nothing"
