"""A tolerance of a quantity: a share of it (``5 %``) or an amount with a unit (``15 ms``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import PlainSerializer, PlainValidator, WithJsonSchema

from grader.findings.words import percent
from grader.spec.quantity import refusal
from grader.spec.unit import UNITS, Dimension, format_duration, parse_quantity


@dataclass(frozen=True)
class TimeTolerance:
    """How far a time may be off.

    Attributes:
        amount: A ratio, or seconds.
        relative: Whether ``amount`` is a ratio of the expected time.
    """

    amount: float
    relative: bool

    def of(self, expected_s: float) -> float:
        """The tolerance in seconds, for an expected time in seconds."""
        return self.amount * expected_s if self.relative else self.amount

    def __str__(self) -> str:
        return percent(self.amount) if self.relative else format_duration(self.amount)


def parse_time_tolerance(text: Any) -> TimeTolerance:
    """Read a tolerance of a time.

    Raises:
        PydanticCustomError: It is negative, or neither a ratio nor a time.
    """
    if isinstance(text, TimeTolerance):
        return text
    for dimension in (Dimension.RATIO, Dimension.TIME):
        try:
            amount = parse_quantity(text, dimension)
        except ValueError:
            continue
        if amount < 0.0:
            raise refusal(f"{text!r} is negative")
        return TimeTolerance(amount, relative=dimension is Dimension.RATIO)
    raise refusal(f"{text!r} is neither a share such as '5 %' nor a time such as '15 ms'")


_FORM = rf"^\s*[0-9.eE+-]+\s*({'|'.join(['%', *UNITS[Dimension.TIME]])})?\s*$"
Tolerance = Annotated[
    TimeTolerance,
    PlainValidator(parse_time_tolerance),
    PlainSerializer(str),
    WithJsonSchema(
        {
            "anyOf": [{"type": "string", "pattern": _FORM}, {"type": "number", "minimum": 0}],
            "description": "A share such as 5 % or a time such as 15 ms.",
        }
    ),
]
