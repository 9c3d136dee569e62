"""Who sees the student's processes do what nobody may, whatever comes of it."""

from __future__ import annotations

from collections.abc import Iterator

from grader.run.cell.graph import GraphObserver
from grader.run.process.output import OutputReader
from grader.run.process.student import StudentProcesses
from grader.sandbox.packet_monitor import Wire, bound_ports

_MOST_MALFORMED = 10
"""Packets; nothing of good manners sends a single one."""
_FORGERY = "wrote into the channel through which rosgrade reports from inside a process"
_NAMES = "made a node or a topic with a name that ROS does not allow, past the checks of rclpy"
_GARBAGE = "sent garbage to the UDP ports of the node that watches the run"


class ViolationWatch:
    """The guard over system calls, the tracer's pipe, the graph and the cell's network."""

    def __init__(
        self,
        students: StudentProcesses,
        output: OutputReader,
        graph: GraphObserver,
        wire: Wire | None,
    ) -> None:
        """Make them known; call it before anything of the student's runs.

        Args:
            wire: Hears the network, or None.
        """
        self._students = students
        self._output = output
        self._graph = graph
        self._wire = wire
        # Of our own participant: nobody else is here yet.
        self._ports = bound_ports() if wire is not None else frozenset()

    def violations(self) -> Iterator[tuple[str, str]]:
        """Everything so far: its kind, and the same in words."""
        for violation in self._students.violations:
            yield "forbidden call", violation
        if self._output.forgers:
            yield "forged report", _FORGERY
        if self._graph.forbidden_names:
            yield "forbidden name", _NAMES
        if self._wire is not None and self._wire.malformed(self._ports) > _MOST_MALFORMED:
            yield "forbidden packets", _GARBAGE
