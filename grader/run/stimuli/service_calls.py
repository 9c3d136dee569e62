"""Calls services of the student's nodes, and keeps requests and responses."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from grader.recording.model import Call
from grader.run.cell.interfaces import import_interface
from grader.run.cell.probe import Probe
from grader.run.stimuli.filling import filled, plain


class ServiceCalls:
    """Clients of the probe, one for each service, and every call so far, oldest first."""

    def __init__(self, probe: Probe, most_bytes: int) -> None:
        self._probe = probe
        self._most_bytes = most_bytes
        self._clients: dict[tuple[str, str], Any] = {}
        self.calls: list[Call] = []

    def is_ready(self, service: str, type: str) -> bool:
        """Whether a server is there, with this type."""
        return bool(self._client(service, type).service_is_ready())

    def send(self, service: str, type: str, request: Mapping[str, Any]) -> int:
        """Send a request; the number of its call."""
        client = self._client(service, type)
        now_ns = time.time_ns()
        message = filled(import_interface(type).Request(), request, now_ns)
        number = len(self.calls)
        self.calls.append(Call(service, type, now_ns, request=plain(message)))
        client.call_async(message).add_done_callback(lambda future: self._answer(number, future))
        return number

    def is_over(self, number: int) -> bool:
        """Whether a call was answered, or never will be."""
        call = self.calls[number]
        return call.answered_ns is not None or bool(call.error)

    def note_unsent(
        self, service: str, type: str, request: Mapping[str, Any], error: str, since_ns: int = 0
    ) -> None:
        """Note a call that could not be sent; without an error the server's node never spun."""
        call = Call(service, type, since_ns or time.time_ns(), request=request, error=error)
        self.calls.append(call)

    def _client(self, service: str, type: str) -> Any:
        key = (service, type)
        if key not in self._clients:
            self._clients[key] = self._probe.node.create_client(import_interface(type), service)
        return self._clients[key]

    def _answer(self, number: int, future: Any) -> None:
        now_ns = time.time_ns()
        if not self._probe.recording:
            return
        call = self.calls[number]
        if future.exception() is not None:
            error = f"the response cannot be read: {future.exception()}"
            self.calls[number] = replace(call, error=error)
            return
        response = plain(future.result())
        if len(json.dumps(response)) > self._most_bytes:
            error = f"the response is larger than {self._most_bytes} bytes"
            self.calls[number] = replace(call, error=error)
            return
        self.calls[number] = replace(call, answered_ns=now_ns, response=response)
