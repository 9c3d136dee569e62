"""A tolerance of a quantity: a share of it (``5 %``) or an amount with a unit (``15 ms``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from grader.checks.wording import percent
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
        """Write ``5 %`` or ``15 ms``."""
        return percent(self.amount) if self.relative else format_duration(self.amount)


def parse_time_tolerance(text: Any) -> TimeTolerance:
    """Read a tolerance of a time.

    Raises:
        ValueError: It is negative, or neither a ratio nor a time.
    """
    if isinstance(text, TimeTolerance):
        return text
    try:
        tolerance = TimeTolerance(parse_quantity(text, Dimension.RATIO), relative=True)
    except ValueError:
        try:
            tolerance = TimeTolerance(parse_quantity(text, Dimension.TIME), relative=False)
        except ValueError:
            raise ValueError(
                f"{text!r} is neither a share such as '5 %' nor a time such as '15 ms'"
            ) from None
    if tolerance.amount < 0.0:
        raise ValueError(f"{text!r} is negative")
    return tolerance


class _Annotation:
    """Pydantic annotation that reads a :class:`TimeTolerance`."""

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Validate by :func:`parse_time_tolerance`."""

        def read(value: Any) -> TimeTolerance:
            try:
                return parse_time_tolerance(value)
            except ValueError as error:
                raise refusal(str(error)) from None

        return core_schema.no_info_plain_validator_function(
            read, serialization=core_schema.to_string_ser_schema()
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe it to an editor."""
        units = "|".join(["%", *UNITS[Dimension.TIME]])
        return {
            "anyOf": [
                {"type": "string", "pattern": rf"^\s*[0-9.eE+-]+\s*({units})?\s*$"},
                {"type": "number", "minimum": 0},
            ],
            "description": "A share such as 5 % or a time such as 15 ms.",
        }


Tolerance = Annotated[TimeTolerance, _Annotation()]
