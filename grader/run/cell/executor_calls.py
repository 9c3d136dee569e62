"""Calls of services that a node answers only while its executor spins, to see whether it does."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from rclpy.exceptions import InvalidServiceNameException
from rclpy.node import Node

from grader.recording.interaction import EXECUTOR_SERVICES, executor_services
from grader.recording.model import Call
from grader.run.cell.interfaces import import_interface

# One lost answer must not end the observation, and a blocked node must not be flooded.
_MOST_UNANSWERED = 5


@dataclass
class _Pending:
    """A call, which is answered when every server of its service has answered."""

    requested_ns: int
    servers: int
    future: Any = None
    answers: int = 0
    answered_ns: int | None = None

    def count_answer(self) -> None:
        """Count the answer of one more server."""
        self.answers += 1
        if self.answers == self.servers:
            self.answered_ns = time.time_ns()


class ExecutorCalls:
    """Sends such calls from the probe's node, and remembers them all.

    Attributes:
        counts_servers: Whether a call is answered only when every server of its service has;
            what is left of a killed process stays in the graph, but answers nothing.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[str, Any] = {}
        self._calls: dict[str, list[_Pending]] = {}
        self.counts_servers = True

    def has_answered(self, node: str) -> bool | None:
        """Whether a node has answered any such call; None if it was not called."""
        calls = self._calls_of(node)
        return any(call.answered_ns is not None for call in calls) if calls else None

    def last_called_ns(self, node: str) -> int:
        """When a node was called for the last time; 0 for never."""
        return max((call.requested_ns for call in self._calls_of(node)), default=0)

    def call(self, node: str, name: str) -> None:
        """Call one of the services of a node, unless it has left many calls unanswered."""
        interface = import_interface(EXECUTOR_SERVICES[name])
        service = f"{node}/{name}"
        if service not in self._clients:
            try:
                client = self._node.create_client(interface, service)
            except InvalidServiceNameException:
                # A node of a very long name, whose own services ROS would not allow either.
                return
            self._clients[service], self._calls[service] = client, []
            _count_answers(client, self._calls[service])
        client, calls = self._clients[service], self._calls[service]
        unanswered = sum(call.answered_ns is None for call in calls)
        if unanswered >= _MOST_UNANSWERED or not client.service_is_ready():
            return
        servers = self._node.count_services(service) if self.counts_servers else 1
        pending = _Pending(time.time_ns(), max(1, servers))
        pending.future = client.call_async(interface.Request())
        calls.append(pending)

    @property
    def calls(self) -> tuple[Call, ...]:
        """Every call so far, oldest first."""
        records = [
            Call(
                service,
                EXECUTOR_SERVICES[service.rpartition("/")[2]],
                call.requested_ns,
                call.answered_ns,
                servers=call.servers,
            )
            for service, calls in self._calls.items()
            for call in calls
        ]
        return tuple(sorted(records, key=lambda call: call.requested_ns))

    def _calls_of(self, node: str) -> list[_Pending]:
        return [call for name in executor_services(node) for call in self._calls.get(name, ())]


def _count_answers(client: Any, calls: list[_Pending]) -> None:
    """Count every answer to a client's calls, of which rclpy hands on only the first.

    rclpy looks up the call of each answer with ``get_pending_request``, which fails from the second
    answer on: so every answer passes here.
    """
    get_pending_request = client.get_pending_request
    call_by_sequence: dict[int, _Pending] = {}

    def counting(sequence: int) -> Any:
        if sequence not in call_by_sequence:
            future = get_pending_request(sequence)
            call_by_sequence[sequence] = next(call for call in calls if call.future is future)
        call_by_sequence[sequence].count_answer()
        return get_pending_request(sequence)

    client.get_pending_request = counting
