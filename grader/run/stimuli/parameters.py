"""Calls services that answer only while a node spins; reads and sets parameters."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rclpy.exceptions import InvalidServiceNameException

from grader.assignment.stimuli.kinds.request import (
    AskDeclared,
    ListParameters,
    ReadParameters,
    SetParameters,
)
from grader.recording.interaction import NO_SERVER
from grader.run.stimuli.calling import Requesting
from grader.run.stimuli.context import Playing, StimulusContext, plays

_ASK_AGAIN_S = 0.5
_LIST_ALL: Mapping[str, Any] = {"prefixes": [], "depth": 0}
"""Request of ``list_parameters`` for every name."""
_TYPES = {
    "list_parameters": "rcl_interfaces/srv/ListParameters",
    "describe_parameters": "rcl_interfaces/srv/DescribeParameters",
    "get_parameters": "rcl_interfaces/srv/GetParameters",
    "set_parameters": "rcl_interfaces/srv/SetParameters",
}


@plays(ReadParameters, SetParameters)
class SettingParameters(Requesting):
    """One round of calls to the parameter services of a node; each waits for the one before."""

    def __init__(self, order: ReadParameters | SetParameters, context: StimulusContext) -> None:
        what = f"parameter services of {order.node}"
        super().__init__(order, what, f"{order.node}/list_parameters", context)
        self._steps: Iterator[int] | None = None
        self._newest_call: int | None = None
        self._done = False

    @property
    def is_done(self) -> bool:
        """Whether every call was answered, or waited for; or the node has no such services."""
        return self._done or self._ready.given_up

    def play(self, elapsed_s: float) -> None:
        """Send the next call, when the one before it was answered."""
        if self._done:
            return
        super().play(elapsed_s)
        if self._steps is None:
            are_there = all(
                self._context.calls.is_ready(f"{self._order.node}/{service}", interface)
                for service, interface in _TYPES.items()
            )
            if not self._ready.may_send(are_there) or not self._is_turn:
                return
            self._steps = self._conversation()
        if self._newest_call is not None and not self._context.calls.is_over(self._newest_call):
            # A node that does not answer one call gets no more.
            self._done = not self._waits
            return
        self._newest_call = next(self._steps, None)
        self._wait_for_answer()
        self._done = self._newest_call is None

    def finish(self) -> None:
        """Note that nothing could be sent, unless it was not due yet."""
        service, type = f"{self._order.node}/list_parameters", _TYPES["list_parameters"]
        note = self._context.calls.note_unsent
        if self._ready.is_in_vain:
            note(service, type, _LIST_ALL, NO_SERVER)
        elif self._ready.never_answered and self._steps is None:
            note(service, type, _LIST_ALL, "", self._ready.appeared_ns)

    def _conversation(self) -> Iterator[int]:
        """Send one call after another, each when the one before it was answered."""
        list_call = self._send("list_parameters", _LIST_ALL)
        yield list_call
        response = self._context.calls.calls[list_call].response or {}
        names = [str(name) for name in response.get("result", {}).get("names", [])]
        if names:
            yield self._send("describe_parameters", {"names": names})
            yield self._send("get_parameters", {"names": names})
        sent = self._order.sent_fields
        values: Mapping[str, Any] = sent[0] if sent else {}
        if not values:
            return
        parameters = [
            {"name": name, "value": parameter_value(value)} for name, value in values.items()
        ]
        yield self._send("set_parameters", {"parameters": parameters})
        known = [name for name in values if name in names]
        if known:
            yield self._send("get_parameters", {"names": known})

    def _send(self, service: str, request: Mapping[str, Any]) -> int:
        name = f"{self._order.node}/{service}"
        return self._context.calls.send(name, _TYPES[service], request)


_PARAMETER_TYPES: Sequence[tuple[type, int, str]] = (
    (bool, 1, "bool"),
    (int, 2, "integer"),
    (float, 3, "double"),
    (str, 4, "string"),
)
"""Python type, number in rcl_interfaces/msg/ParameterType, and the beginning of its field."""


def parameter_value(value: Any) -> dict[str, Any]:
    """A bool, number, str, or a list of one kind of these, as rcl_interfaces/msg/ParameterValue."""
    is_array = isinstance(value, list)
    if is_array and any(isinstance(item, float) for item in value):
        value = [float(item) for item in value]
    sample = value[0] if is_array else value
    # The order matters: a bool of Python is an int too.
    kind, number, word = next(row for row in _PARAMETER_TYPES if isinstance(sample, row[0]))
    if not is_array:
        return {"type": number, f"{word}_value": kind(value)}
    # Behind the four scalars come byte_array and then the arrays in the same order.
    return {"type": number + 5, f"{word}_array_value": value}


@plays(AskDeclared)
class AskingForDeclared(Playing):
    """One call to each node; again while some of the names are not among its answers."""

    def __init__(self, order: AskDeclared, context: StimulusContext) -> None:
        super().__init__(order, context)
        self._next_s = 0.0
        self._newest_calls: dict[str, int] = {}

    def tick(self, elapsed_s: float | None) -> None:
        """Ask the nodes that have not answered yet, or not with every name."""
        now_s, calls, type_ = time.monotonic(), self._context.calls, _TYPES["list_parameters"]
        if now_s < self._next_s or not self._context.is_set_up:
            return
        self._next_s = now_s + _ASK_AGAIN_S
        answers = [calls.calls[number].response or {} for number in self._newest_calls.values()]
        names = {name for one in answers for name in one.get("result", {}).get("names", ())}
        has_every_name = names.issuperset(self._order.names)
        for node in self._context.student_nodes:
            newest = self._newest_calls.get(node)
            if newest is not None and (has_every_name or not calls.is_over(newest)):
                continue
            service = f"{node}/list_parameters"
            with contextlib.suppress(InvalidServiceNameException):
                if calls.is_ready(service, type_):
                    self._newest_calls[node] = calls.send(service, type_, _LIST_ALL)


def next_call_s(due_s: float, every_s: float, now_s: float) -> float:
    """When to call again: at the next whole period after the time at which this call was due.

    Counted from a call that came late, those after it would move to other times within the
    student's period, and could miss a callback that is busy in the same part of each.
    """
    return due_s + every_s * (1 + (now_s - due_s) // every_s)


@plays(ListParameters)
class ListingParameters(Playing):
    """Calls ``list_parameters`` of every node, or what stands in for it; it has no end."""

    def __init__(self, order: ListParameters, context: StimulusContext) -> None:
        super().__init__(order, context)
        self._next_s = 0.0
        self._due_s: float | None = None

    @property
    def due_s(self) -> float | None:
        """When to call next: calls after each message would follow the student's rhythm."""
        return self._due_s

    def tick(self, elapsed_s: float | None) -> None:
        """Call when it is due; also before the first match, since a node may be blocked."""
        now_s, every_s = time.monotonic(), self._order.every
        if now_s >= self._next_s and self._context.is_set_up:
            self._next_s = next_call_s(self._next_s or now_s, every_s, now_s)
            for name in self._context.student_nodes:
                self._context.call_executor(name)
        self._due_s = None
        if elapsed_s is not None and self._next_s > now_s:
            self._due_s = elapsed_s + self._next_s - now_s
