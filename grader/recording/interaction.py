"""Facts of services and actions: who offers and who uses them, and what was asked.

Times are integer nanoseconds since the Unix epoch, as everywhere in a recording.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

NO_SERVER = "no server"
"""Error of a request to a missing server."""

EXECUTOR_SERVICES = {
    "list_parameters": "rcl_interfaces/srv/ListParameters",
    "get_type_description": "type_description_interfaces/srv/GetTypeDescription",
}
"""What nodes offer by themselves and answer only while their executor spins: name -> type.

The first is called; the second where a node was made with ``start_parameter_services=False``.
"""


def executor_services(node: str) -> tuple[str, ...]:
    """The same of one node, by their full names."""
    return tuple(f"{node}/{name}" for name in EXECUTOR_SERVICES)


@dataclass(frozen=True)
class Service:
    """A service that a node of the student offers or uses; an action is five topics and services.

    Attributes:
        name: Fully qualified, such as ``/add`` or ``/fibonacci/_action/send_goal``.
        type: Interface name, such as ``std_srvs/srv/SetBool``.
        node: Fully qualified node name.
        appeared_ns: First time it was seen.
        vanished_ns: First time it was missing again, or None.
    """

    name: str
    type: str
    node: str
    appeared_ns: int
    vanished_ns: int | None = None


@dataclass(frozen=True)
class Feedback:
    """Feedback of a goal.

    Attributes:
        time_ns: When the probe received it.
        value: Its fields.
    """

    time_ns: int
    value: Mapping[str, Any]


@dataclass(frozen=True)
class Goal:
    """A goal that the probe sent to an action server.

    Attributes:
        action: Fully qualified name.
        type: Interface name, such as ``example_interfaces/action/Fibonacci``.
        goal: Its fields.
        sent_ns: When it was sent, or due if no server was there.
        accepted: The server's answer, or None if there was none by the end.
        answered_ns: When that answer was there, or None.
        feedback: In the order of its reception.
        statuses: When the probe received a status of the goal, and which, such as ``executing``.
        cancel_after_s: Time from acceptance to the cancel request in s; None for no request.
        canceled_ns: When the probe asked to cancel it, or None.
        cancel_answered_ns: When that was answered, or None.
        cancel_accepted: Whether the server agreed to cancel it; None without an answer.
        status: Final status, as in ``statuses``; empty if there was none by the end.
        result: Fields of the result, or None.
        result_ns: When the result was there, or None.
        preempts: It was sent on purpose while the previous goal was still executed.
        preempted: Another goal was sent on purpose while this goal was still executed.
        error: Why it could not be sent: ``no server``, or what went wrong in rosgrade.
    """

    action: str
    type: str
    goal: Mapping[str, Any]
    sent_ns: int
    accepted: bool | None = None
    answered_ns: int | None = None
    feedback: tuple[Feedback, ...] = ()
    statuses: tuple[tuple[int, str], ...] = ()
    cancel_after_s: float | None = None
    canceled_ns: int | None = None
    cancel_answered_ns: int | None = None
    cancel_accepted: bool | None = None
    status: str = ""
    result: Mapping[str, Any] | None = None
    result_ns: int | None = None
    preempts: bool = False
    preempted: bool = False
    error: str = ""


@dataclass(frozen=True)
class Asked:
    """A request or a goal of the student's to a service or an action that the scenario serves.

    Attributes:
        server: Fully qualified name of the service or action.
        type: Interface name.
        fields: Of the request or goal.
        asked_ns: When the probe received it.
        status: ``answered`` for a request; for a goal ``accepted``, ``rejected``, or as it ended:
            ``succeeded``, ``aborted``, ``canceled``; empty before, ``unanswered`` if the scenario
            never answers it.
        accepted_ns: When a goal was accepted, or None.
        feedback: Of a goal, as it was given.
        canceled_ns: When the client first asked to cancel a goal, or None.
        ended_ns: When it got its response, its rejection or its result, or None.
        answer: Fields of the response or the result, or None.
    """

    server: str
    type: str
    fields: Mapping[str, Any]
    asked_ns: int
    status: str = ""
    accepted_ns: int | None = None
    feedback: tuple[Feedback, ...] = ()
    canceled_ns: int | None = None
    ended_ns: int | None = None
    answer: Mapping[str, Any] | None = None
