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
_QUOTED_LINES = 3
_SETTLED_S = 1.0
"""Nodes of a launch file come one after the other; what comes later would be the student's."""


class Companions:
    """Starts, watches and stops them, as the student's programs; nothing of theirs is judged.

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
        self._has_launch_files = any(one.is_launch_file for one in order.companions)
        self._since_start: Stopwatch | None = None
        """Runs until they are ready."""

    @property
    def pids(self) -> frozenset[int]:
        """Every process of theirs."""
        return self._processes.pids

    def start(self, domain_id: int) -> None:
        """Start them; what is new in the graph is theirs until they are ready."""
        self._graph.newcomers = Owner.COMPANION
        self._since_start = Stopwatch(self._meter)
        domain = {"ROS_DOMAIN_ID": str(domain_id)}
        environment, folder = self._order.companion_environment, Path(self._order.scratch)
        for program in self._order.companions:
            self._processes.launch(program.name, program.argv, environment, domain, folder)

    def are_ready(self) -> bool:
        """Whether all of them are in the graph; if so, what is new after that is the student's."""
        if self._missing() is not None:
            return False
        if self._has_launch_files and time.time_ns() - self._graph.changed_ns < _SETTLED_S * NS:
            return False
        self._processes.refresh()
        self._graph.newcomers = Owner.STUDENT
        self._since_start = None
        if self._simulator is not None:
            self._simulator.begin()
        return True

    def faults(self) -> list[str]:
        """A sentence for each that ended by an error, that is not ready in time, or is silent."""
        self._processes.poll()
        faults = self._ended()
        if not faults and self._simulator is not None:
            self._simulator.look()
            faults = list(self._simulator.faults())
        return faults or self._late()

    def _ended(self) -> list[str]:
        """Of each that ended by an error; a simulator must not end at all."""
        faults = []
        for process in self._processes.records():
            is_simulator = self._simulator is not None and process.name == self._simulator.name
            if process.exited_ns is not None and (process.exit_code or is_simulator):
                faults.append(
                    f"the {'simulator' if is_simulator else 'companion'} {process.name} of the "
                    f"assignment ended with exit code {process.exit_code}: "
                    f"{self._last_lines(process.name)}"
                )
        return faults

    def _late(self) -> list[str]:
        """That they are not ready in time."""
        limit_s = self._order.limits.discovery_s
        if self._simulator is not None:
            limit_s = self._simulator.within_s
        if self._since_start is None or self._since_start.elapsed_s <= limit_s:
            return []
        why = self._missing() or "new nodes come all the time"
        programs = self._order.companions
        return [
            f"the programs of the assignment ({', '.join(one.name for one in programs)}) were not "
            f"ready within {format_duration(limit_s)}: {why}. The first of them printed last: "
            f"{self._last_lines(programs[0].name)}"
        ]

    def stop(self) -> list[str]:
        """End them, and say what went wrong before."""
        faults = self.faults()
        self._processes.stop(self._order.limits)
        return faults

    def clean_up(self) -> None:
        """Kill what is left of them, and read the rest of their output."""
        self._processes.clean_up()
        self._output.close(_PIPES_LIMIT_S)

    def _missing(self) -> str | None:
        """What is not in the graph yet, or None."""
        nodes = [node for node in self._graph.nodes if node.owner is Owner.COMPANION]
        if len(nodes) < len(self._order.companions):
            return "they have not one node each"
        return self._simulator.lacks() if self._simulator is not None else None

    def _last_lines(self, process: str) -> str:
        """What a process printed last on stderr."""
        lines = self._output.tail(process, "stderr", _QUOTED_LINES)
        return " ".join(lines) or "it printed nothing"
