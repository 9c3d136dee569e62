"""Processes that would end at once are let go only when what they declared was seen."""

from __future__ import annotations

from grader.recording.model import Owner
from grader.run.cell.graph import GraphObserver
from grader.run.process.output import OutputReader
from grader.run.process.student import StudentProcesses


class ExitBarrier:
    """Keeps the processes that wait to end, by their tracers' word, until the graph has them."""

    def __init__(
        self, output: OutputReader, graph: GraphObserver, students: StudentProcesses
    ) -> None:
        """Prepare; nobody waits yet."""
        self._output = output
        self._graph = graph
        self._students = students
        self._given = 0

    @property
    def is_asked(self) -> bool:
        """Whether a process waits that was not let go yet."""
        return len(self._waiting()) > self._given

    def give(self) -> None:
        """Let go whoever waits, if all that was declared stands in the graph."""
        if not self.is_asked or not self._all_seen():
            return
        waiting = self._waiting()
        for name in waiting[self._given :]:
            self._students.let_exit(name)
        self._given = len(waiting)

    def _waiting(self) -> list[str]:
        return [item.process for item in self._output.declarations if item.kind == "leaving"]

    def _all_seen(self) -> bool:
        nodes = {node.name for node in self._graph.nodes}
        announced = {
            (endpoint.kind.value, endpoint.topic)
            for endpoint in self._graph.endpoints
            if endpoint.owner is not Owner.PROBE
        }
        for declaration in self._output.declarations:
            kind, data = declaration.kind, declaration.data
            if kind == "node" and str(data.get("node")) not in nodes:
                return False
            is_endpoint = kind in ("publisher", "subscription")
            if is_endpoint and (kind, str(data.get("topic"))) not in announced:
                return False
        return True
