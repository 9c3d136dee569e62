"""What a cell is to do besides observing, one kind of order per kind of stimulus. JSON in and out.

The values of messages are plain and complete here: files are read, functions called and random
values filled in by whoever gives the order, so that a cell needs nothing of the assignment.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, get_args


@dataclass(frozen=True)
class PublishOrder:
    """Publish messages.

    Attributes:
        repeat_s: Repeat the last one with this period until the end, or None.
        answer: Wait for a message on this topic before the next, or None.
    """

    topic: str
    type: str
    reliability: str
    durability: str
    depth: int
    messages: tuple[dict[str, Any], ...]
    times_s: tuple[float, ...]
    before_launch: int = 0
    after_s: float = 0.0
    repeat_s: float | None = None
    answer: str | None = None
    within_s: float = 1.0


@dataclass(frozen=True)
class JoinOrder:
    """Subscribe late."""

    name: str
    topic: str
    type: str
    reliability: str
    durability: str
    depth: int
    after_s: float


@dataclass(frozen=True)
class KillOrder:
    """Send a signal to a process.

    Attributes:
        process: ``package/executable``.
    """

    process: str
    signal: str
    after_s: float


@dataclass(frozen=True)
class RestartOrder:
    """End a process if it still runs, and start it again.

    Attributes:
        process: ``package/executable``.
    """

    process: str
    after_s: float


@dataclass(frozen=True)
class ListParametersOrder:
    """Call the parameter services of all nodes of the student."""

    every_s: float


@dataclass(frozen=True)
class CallOrder:
    """Call a service.

    Attributes:
        every_s: Time between two requests; None for the next after the answer.
    """

    service: str
    type: str
    requests: tuple[dict[str, Any], ...]
    at_once: int = 1
    after_s: float = 0.0
    every_s: float | None = None
    within_s: float = 2.0


@dataclass(frozen=True)
class ParametersOrder:
    """Read the parameters of a node, and set some of them.

    Attributes:
        values: What to set; empty to read only.
    """

    node: str
    values: dict[str, Any]
    after_s: float = 0.0
    within_s: float = 2.0


@dataclass(frozen=True)
class GoalOrder:
    """Send a goal to an action.

    Attributes:
        cancel_after_s: Ask to cancel it so long after it was accepted, or None.
    """

    action: str
    type: str
    goal: dict[str, Any]
    after_s: float = 0.0
    cancel_after_s: float | None = None
    preempt: bool = False
    within_s: float = 10.0


StimulusOrder = (
    PublishOrder
    | JoinOrder
    | KillOrder
    | RestartOrder
    | ListParametersOrder
    | CallOrder
    | ParametersOrder
    | GoalOrder
)

_KINDS: dict[str, Callable[..., StimulusOrder]] = {
    one.__name__: one for one in get_args(StimulusOrder)
}


def to_dict(order: StimulusOrder) -> dict[str, Any]:
    """For JSON, with the name of its kind."""
    return {"kind": type(order).__name__, **dataclasses.asdict(order)}


def from_dict(data: Mapping[str, Any]) -> StimulusOrder:
    """Read what :func:`to_dict` made, after JSON made lists of its tuples."""
    values = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in data.items()
        if key != "kind"
    }
    return _KINDS[data["kind"]](**values)
