"""Who sees the student's processes do what nobody may, whatever comes of it."""

from __future__ import annotations

from collections.abc import Iterator

from grader.run.output import OutputReader
from grader.run.student import StudentProcesses
from grader.sandbox.wire import Wire, bound_ports

_MOST_MALFORMED = 10
"""Packets; nothing of good manners sends a single one."""
_FORGERY = "wrote into the channel through which rosgrade reports from inside a process"
_GARBAGE = "sent garbage to the UDP ports of the node that watches the run"


class Witnesses:
    """The guard over system calls, the tracer's pipe and the cell's network."""

    def __init__(self, students: StudentProcesses, output: OutputReader, wire: Wire | None) -> None:
        """Make them known; call it before anything of the student's runs.

        Args:
            students: Under guard.
            output: Reads the tracer's pipe.
            wire: Hears the network, or None.
        """
        self._students = students
        self._output = output
        self._wire = wire
        # Of our own participant: nobody else is here yet.
        self._ports = bound_ports() if wire is not None else frozenset()

    def deeds(self) -> Iterator[tuple[str, str]]:
        """Everything so far: its kind, and the same in words."""
        for deed in self._students.deeds:
            yield "forbidden call", deed
        if self._output.forgers:
            yield "forged report", _FORGERY
        if self._wire is not None and self._wire.malformed(self._ports) > _MOST_MALFORMED:
            yield "forbidden packets", _GARBAGE
