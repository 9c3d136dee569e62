"""Why the values of a series come in another order than expected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from grader.diagnosis.explanation import Symptom, explanation, mistaken, remedy
from grader.findings.expected import same
from grader.findings.fields import wanted_text
from grader.findings.finding import Finding


@dataclass(frozen=True)
class WrongOrder(Symptom[Finding]):
    """The values of a series come in another order.

    What a cause observes is a clause that follows the first wrong value, or nothing.

    Attributes:
        step: How much the value should grow in each message, or None for a list of values.
    """

    found: Sequence[Any]
    step: float | None
    tolerance: float

    @cached_property
    def steps(self) -> list[Any]:
        """How much the value grows in each message, if it should count."""
        return [] if self.step is None else [b - a for a, b in pairwise(self.found)]


def plain(value: Any) -> str:
    """A value as people write it, whole numbers without a decimal point."""
    is_whole = isinstance(value, float) and value.is_integer()
    return wanted_text(int(value) if is_whole else value)


@explanation(WrongOrder)
def never_changes(symptom: WrongOrder) -> Finding | None:
    """The value never changes: it is not kept in the node, or never counted up."""
    if not symptom.steps or any(symptom.steps):
        return None
    return mistaken("never_changes", ": the value never changes")


@explanation(WrongOrder)
def other_step(symptom: WrongOrder) -> Finding | None:
    """The value begins with another number, or grows by another step."""
    steps = symptom.steps
    if not steps or not all(same(steps[0], item, symptom.tolerance) for item in steps):
        return None
    grows = f"it begins with {plain(symptom.found[0])} and grows by {plain(steps[0])}"
    return Finding(f": {grows} from message to message", _each_once(symptom))


@explanation(WrongOrder)
def starts_again(symptom: WrongOrder) -> Finding | None:
    """The value goes back to the first one: a reset, an overflow, or two publishers."""
    found = symptom.found
    if not symptom.steps or found[0] not in found[1:] or not symptom.steps[0]:
        return None
    return mistaken(
        "starts_again",
        f": it goes back to the first value in message {found.index(found[0], 1) + 1}",
    )


@explanation(WrongOrder, general=True)
def other_order(symptom: WrongOrder) -> Finding:
    """Values are left out, repeated or exchanged."""
    return Finding("", _each_once(symptom))


def _each_once(symptom: WrongOrder) -> str:
    if symptom.step is None:
        return remedy("not_in_order")
    return remedy("other_step", step=plain(symptom.step))
