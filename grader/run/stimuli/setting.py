"""Reads the parameters of a node, sets some of them, and reads those again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grader.run.stimuli.asking import NO_SERVER, Asked
from grader.run.stimuli.calling import Asking
from grader.run.stimuli.context import StimulusContext, plays

_EVERY: Mapping[str, Any] = {"prefixes": [], "depth": 0}
_TYPES = {
    "list_parameters": "rcl_interfaces/srv/ListParameters",
    "describe_parameters": "rcl_interfaces/srv/DescribeParameters",
    "get_parameters": "rcl_interfaces/srv/GetParameters",
    "set_parameters": "rcl_interfaces/srv/SetParameters",
}


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


@plays(ParametersOrder)
class SettingParameters(Asking):
    """One round of calls to the parameter services of a node; each waits for the one before."""

    def __init__(self, order: ParametersOrder, context: StimulusContext) -> None:
        """Nothing is asked yet."""
        what = f"parameter services of {order.node}"
        super().__init__(order, what, f"{order.node}/list_parameters", context)
        self._order = order
        self._steps: Iterator[Asked] | None = None
        self._asked: Asked | None = None
        self._done = False

    @property
    def is_done(self) -> bool:
        """Whether every call was answered, or waited for; or the node has no such services."""
        return self._done or self._ready.given_up

    def tick(self, elapsed_s: float | None) -> None:
        """Ask the next, when the one before it was answered."""
        if elapsed_s is None or elapsed_s < self._order.after_s or self._done:
            return
        self._go_on(elapsed_s)
        if self._steps is None:
            there = all(
                self._context.asker.is_ready(f"{self._order.node}/{service}", interface)
                for service, interface in _TYPES.items()
            )
            if not self._ready.met(there) or not self._is_turn:
                return
            self._steps = self._conversation()
        if self._asked is not None and not self._asked.is_over:
            # A node that does not answer one call is not asked more.
            self._done = not self._waits
            return
        self._asked = next(self._steps, None)
        self._wait_for_answer()
        self._done = self._asked is None

    def finish(self) -> None:
        """Note that nothing could be asked, unless it was not due yet."""
        service, type = f"{self._order.node}/list_parameters", _TYPES["list_parameters"]
        if self._ready.is_in_vain:
            self._context.asker.fail(service, type, _EVERY, NO_SERVER)
        elif self._ready.never_answered and self._steps is None:
            self._context.asker.wait(service, type, _EVERY, self._ready.there_ns)

    def _conversation(self) -> Iterator[Asked]:
        listed = self._ask("list_parameters", _EVERY)
        yield listed
        names = _names(listed)
        if names:
            yield self._ask("describe_parameters", {"names": names})
            yield self._ask("get_parameters", {"names": names})
        if not self._order.values:
            return
        values = self._order.values
        yield self._ask(
            "set_parameters",
            {
                "parameters": [
                    {"name": name, "value": parameter_value(value)}
                    for name, value in values.items()
                ]
            },
        )
        known = [name for name in values if name in names]
        if known:
            yield self._ask("get_parameters", {"names": known})

    def _ask(self, service: str, request: Mapping[str, Any]) -> Asked:
        name = f"{self._order.node}/{service}"
        return self._context.asker.ask(name, _TYPES[service], request)


def _names(listed: Asked) -> list[str]:
    result = (listed.response or {}).get("result", {})
    return [str(name) for name in result.get("names", [])]


def parameter_value(value: Any) -> dict[str, Any]:
    """A value as rcl_interfaces/msg/ParameterValue.

    Args:
        value: A truth, a number, a text, or a list of one kind of these, not empty.
    """
    many = isinstance(value, list)
    kinds: Sequence[tuple[type, int, str]] = (
        (bool, 1, "bool"),
        (int, 2, "integer"),
        (float, 3, "double"),
        (str, 4, "string"),
    )
    if many and any(isinstance(item, float) for item in value):
        value = [float(item) for item in value]
    kind, number, word = next(
        item for item in kinds if isinstance(value[0] if many else value, item[0])
    )
    if not many:
        return {"type": number, f"{word}_value": kind(value)}
    # Behind the four scalars come byte_array and then the arrays in the same order.
    return {"type": number + 5, f"{word}_array_value": value}
