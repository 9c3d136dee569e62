"""Services, calls, goals and logs made by hand; times are seconds since launch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from grader.recording.interaction import Asked, Feedback, Goal, Service
from grader.recording.model import Call, LogLine, Owner, Recording
from tests.checks.builder import BOT, NODE, at, endpoint, recording

SET_BOOL = "std_srvs/srv/SetBool"
FIBONACCI = "example_interfaces/action/Fibonacci"
_PARAMETERS = "rcl_interfaces/srv/"


def service(name: str = "/enable", type: str = SET_BOOL, node: str = NODE) -> Service:
    """A service that the student's node offers."""
    return Service(name, type, node, at(0.4))


def action(name: str = "/fibonacci", type: str = FIBONACCI, node: str = NODE) -> Service:
    """What shows that a node offers an action."""
    return Service(f"{name}/_action/send_goal", f"{type}_SendGoal", node, at(0.4))


def asked(
    time_s: float = 1.0,
    answer_s: float | None = 0.01,
    *,
    request: Mapping[str, Any] | None = None,
    response: Mapping[str, Any] | None = None,
    name: str = "/enable",
    type: str = SET_BOOL,
    error: str = "",
) -> Call:
    """A call with its request, answered so many seconds later."""
    return Call(
        name,
        type,
        at(time_s),
        None if answer_s is None else at(time_s + answer_s),
        {"data": True} if request is None else request,
        None if answer_s is None else response or {"success": True, "message": "enabled"},
        error,
    )


def serving(*calls: Call, **changes: Any) -> Recording:
    """A run of a node that offers /enable, with these calls to it."""
    return recording(**{"services": (service(),), "calls": calls, **changes})


def goal(
    order: int = 4,
    time_s: float = 1.0,
    *,
    accepted: bool | None = True,
    period_s: float = 0.1,
    end_s: float | None = 0.5,
    status: str = "succeeded",
    sequence: Sequence[int] = (0, 1, 1, 2, 3),
    **changes: Any,
) -> Goal:
    """A goal with feedback every 100 ms, which ends after 0.5 s."""
    feedback = tuple(
        Feedback(at(time_s + period_s * n), {"sequence": list(sequence[: n + 2])})
        for n in range(1, len(sequence) - 1)
    )
    ended = accepted and end_s is not None
    values: dict[str, Any] = {
        "action": "/fibonacci",
        "type": FIBONACCI,
        "goal": {"order": order},
        "sent_ns": at(time_s),
        "accepted": accepted,
        "answered_ns": None if accepted is None else at(time_s + 0.01),
        "feedback": feedback if accepted else (),
        "status": status if ended else "",
        "result": {"sequence": list(sequence)} if ended else None,
        "result_ns": at(time_s + (end_s or 0.0)) if ended else None,
    }
    return Goal(**{**values, **changes})


def canceled(**changes: Any) -> Goal:
    """A goal that was asked to cancel 0.2 s after it was accepted, and was 0.1 s later."""
    values = {
        "status": "canceled",
        "end_s": 0.31,
        "cancel_after_s": 0.2,
        "canceled_ns": at(1.21),
        "cancel_answered_ns": at(1.22),
        "cancel_accepted": True,
    }
    return goal(**{**values, **changes})


def acting(*goals: Goal, **changes: Any) -> Recording:
    """A run of a node that offers /fibonacci, with these goals."""
    return recording(**{"services": (action(),), "goals": goals, **changes})


def to_service(time_s: float = 1.0, took_s: float | None = 0.5, **changes: Any) -> Asked:
    """A request of a client of the student to /enable, answered so many seconds later."""
    values: dict[str, Any] = {"server": "/enable", "type": SET_BOOL, "fields": {"data": True}}
    if took_s is not None:
        answer = {"success": True, "message": ""}
        values |= {"status": "answered", "ended_ns": at(time_s + took_s), "answer": answer}
    return Asked(**{**values, "asked_ns": at(time_s), **changes})


def to_action(order: int = 4, time_s: float = 1.0, status: str = "succeeded", **more: Any) -> Asked:
    """A goal of a client of the student to /fibonacci, ended 0.5 s later."""
    values: dict[str, Any] = {
        **{"server": "/fibonacci", "type": FIBONACCI, "fields": {"order": order}},
        **{"asked_ns": at(time_s), "status": status},
    }
    if status != "unanswered":
        values |= {"accepted_ns": at(time_s), "ended_ns": at(time_s + 0.5)}
    return Asked(**{**values, **more})


def asking(*requests: Asked, **changes: Any) -> Recording:
    """A run of a node with clients of /enable and /fibonacci, which asked for these."""
    served = endpoint("/fibonacci/_action/status", type="x/msg/X", owner=Owner.PROBE)
    found = {"clients": (service(), action()), "endpoints": (served,), "messages": {}}
    return recording(**{**found, "asked": requests, **changes})


def value_message(value: Any) -> dict[str, Any]:
    """An rcl_interfaces/msg/ParameterValue."""
    kinds = {bool: (1, "bool_value"), int: (2, "integer_value"), float: (3, "double_value"),
             str: (4, "string_value")}  # fmt: skip
    number, key = kinds[type(value)]
    return {"type": number, key: value}


def parameters_read(
    time_s: float = 0.8, *, node: str = NODE, ranges: Mapping[str, Any] | None = None, **values: Any
) -> tuple[Call, ...]:
    """What the parameter services answer: names, descriptors, values."""
    names = [*values, "use_sim_time"]
    descriptors = [
        {
            "name": name,
            "type": value_message(value)["type"],
            "read_only": name.startswith("fixed"),
            "description": "What it is." if name == "speed" else "",
            "floating_point_range": [dict((ranges or {})[name])] if name in (ranges or {}) else [],
            "integer_range": [],
        }
        for name, value in values.items()
    ]
    read = [value_message(value) for value in values.values()]
    return (
        _call(time_s, node, "list_parameters", {"depth": 0}, {"result": {"names": names}}),
        _call(time_s + 0.01, node, "describe_parameters", {"names": names},
              {"descriptors": descriptors}),
        _call(time_s + 0.02, node, "get_parameters", {"names": names}, {"values": read}),
    )  # fmt: skip


def parameter_set(
    time_s: float,
    name: str,
    value: Any,
    after: Any = None,
    *,
    accepted: bool = True,
    reason: str = "",
    node: str = NODE,
) -> tuple[Call, ...]:
    """A parameter that is set, and read again."""
    wanted = {"parameters": [{"name": name, "value": value_message(value)}]}
    result = {"results": [{"successful": accepted, "reason": reason}]}
    found = {"values": [value_message(value if after is None else after)]}
    return (
        _call(time_s, node, "set_parameters", wanted, result),
        _call(time_s + 0.02, node, "get_parameters", {"names": [name]}, found),
    )


def _call(time_s: float, node: str, name: str, request: Any, response: Any) -> Call:
    parts = "".join(part.capitalize() for part in name.split("_"))
    return asked(
        time_s, 0.005, request=request, response=response, name=f"{node}/{name}",
        type=f"{_PARAMETERS}{parts}",
    )  # fmt: skip


def logs(
    text: str, time_s: float = 1.0, level: str = "INFO", logger: str = "bot_publisher"
) -> tuple[LogLine, ...]:
    """One record of a logger: on /rosout, and the line that it writes."""
    time_ns = at(time_s)
    stamp = f"{time_ns // 10**9}.{time_ns % 10**9:09d}"
    return (
        LogLine(time_ns, logger, "rosout", text, level),
        LogLine(time_ns + 10**6, BOT, "stderr", f"[{level}] [{stamp}] [{logger}]: {text}"),
    )
