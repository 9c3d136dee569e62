"""Calls services of the student's nodes, and keeps what was asked and answered."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from grader.recording.model import Call
from grader.run.cell.probe import Probe, import_interface
from grader.run.stimuli.filling import filled, plain

NO_SERVER = "no server"


@dataclass
class Asked:
    """A call under way, or one that could not be sent.

    Attributes:
        answered_ns: When the answer was there, or None.
        response: Its fields, or None.
    """

    service: str
    type: str
    request: Mapping[str, Any]
    requested_ns: int
    answered_ns: int | None = None
    response: Mapping[str, Any] | None = None
    error: str = ""

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come of it."""
        return self.answered_ns is not None or bool(self.error)

    @property
    def record(self) -> Call:
        """For the recording."""
        return Call(**vars(self))


class Asker:
    """Clients of the probe, one for each service."""

    def __init__(self, probe: Probe, most_bytes: int) -> None:
        """Nothing is asked yet."""
        self._probe = probe
        self._most_bytes = most_bytes
        self._clients: dict[tuple[str, str], Any] = {}
        self._asked: list[Asked] = []

    @property
    def calls(self) -> tuple[Call, ...]:
        """Every call so far."""
        return tuple(item.record for item in self._asked)

    def is_ready(self, service: str, type: str) -> bool:
        """Whether a server is there, with this type.

        Raises:
            ImportError: The interface does not exist here.
        """
        return bool(self._client(service, type).service_is_ready())

    def ask(self, service: str, type: str, request: Mapping[str, Any]) -> Asked:
        """Send a request.

        Args:
            request: Its fields; checked when the order was made.
        """
        client = self._client(service, type)
        now_ns = time.time_ns()
        message = filled(import_interface(type).Request(), request, now_ns)
        asked = Asked(service, type, plain(message), now_ns)
        self._asked.append(asked)
        client.call_async(message).add_done_callback(lambda future: self._answer(asked, future))
        return asked

    def fail(self, service: str, type: str, request: Mapping[str, Any], error: str) -> Asked:
        """Note a call that could not be sent."""
        asked = Asked(service, type, request, time.time_ns(), error=error)
        self._asked.append(asked)
        return asked

    def wait(self, service: str, type: str, request: Mapping[str, Any], since_ns: int) -> None:
        """Note a call that waited to be sent since a time: the server's node never spun."""
        self._asked.append(Asked(service, type, request, since_ns))

    def _client(self, service: str, type: str) -> Any:
        key = (service, type)
        if key not in self._clients:
            self._clients[key] = self._probe.node.create_client(import_interface(type), service)
        return self._clients[key]

    def _answer(self, asked: Asked, future: Any) -> None:
        now_ns = time.time_ns()
        if not self._probe.recording:
            return
        error = future.exception()
        if error is not None:
            asked.error = f"the response cannot be read: {error}"
            return
        response = plain(future.result())
        if len(json.dumps(response)) > self._most_bytes:
            asked.error = f"the response is larger than {self._most_bytes} bytes"
            return
        asked.answered_ns, asked.response = now_ns, response
