"""What the runner and the prefork server say to each other.

A request is one packet of JSON over a socket: ``{"arguments": …, "imports": …, "private": …}`` for
a new cell, or ``{"kill": pid}``. With the first come four descriptors: the cell's 0, 1 and 2, and a
pipe on which the server reports that the cell has started, and later that it has ended.
"""

from __future__ import annotations

import json
import math
import os
import select
import socket
import struct
from collections.abc import Collection
from typing import Any, NamedTuple

_REPORT = struct.Struct("=id")
_REQUEST_BYTES = 65_536
_DESCRIPTORS = 4


class Report(NamedTuple):
    """What the server reports on a cell.

    Attributes:
        value: At its start its process id, as the server counts processes; at its end its exit
            status, as in :mod:`subprocess`.
        cpu_s: At its end, its CPU time and that of its children; 0 at its start.
    """

    value: int
    cpu_s: float

    def send(self, pipe: int) -> None:
        """Write it.

        Raises:
            BrokenPipeError: The runner is gone.
        """
        os.write(pipe, _REPORT.pack(*self))


def read_report(pipe: int) -> Report | None:
    """Read one report; None where the server has ended without one."""
    data = os.read(pipe, _REPORT.size)
    return Report(*_REPORT.unpack(data)) if data else None


def send_request(requests: socket.socket, request: dict[str, Any], descriptors: list[int]) -> None:
    """Send one request."""
    socket.send_fds(requests, [json.dumps(request).encode()], descriptors)


def read_request(requests: socket.socket) -> tuple[dict[str, Any] | None, list[int]]:
    """Read one request and its descriptors; the request is None where the runner has gone."""
    text, descriptors, _, _ = socket.recv_fds(requests, _REQUEST_BYTES, _DESCRIPTORS)
    return (json.loads(text) if text else None), descriptors


def readable(descriptors: Collection[int], limit_s: float | None = None) -> set[int]:
    """Wait until descriptors can be read or have ended; any number of them, unlike select(2)."""
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    ready = poll.poll(None if limit_s is None else math.ceil(1000 * limit_s))
    return {descriptor for descriptor, _ in ready}
