"""Quantities with units as fields of models: ``300 ms`` in YAML, seconds in the code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from grader.spec.unit import (
    UNITS,
    Dimension,
    parse_quantity,
    quantity_pattern,
    write_quantity,
)


def refusal(text: str) -> PydanticCustomError:
    """The error that a validator raises, with a text for the author of the YAML."""
    return PydanticCustomError("quantity", "{text}", {"text": text})


def written_as_read(read: Callable[[Any], Any], write: Callable[[Any], Any]) -> CoreSchema:
    """A schema for a value with a form of its own in YAML."""
    return core_schema.no_info_plain_validator_function(
        read,
        serialization=core_schema.plain_serializer_function_ser_schema(
            write, when_used="json-unless-none"
        ),
    )


@dataclass(frozen=True)
class QuantityOf:
    """Pydantic annotation: a quantity of one dimension, held as a float in SI units."""

    dimension: Dimension
    minimum: float | None = None
    exclusive: bool = False

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Validate by :func:`parse_quantity`."""

        def read(value: Any) -> float:
            try:
                number = parse_quantity(value, self.dimension)
            except ValueError as error:
                raise refusal(str(error)) from None
            if self.minimum is not None and (
                number < self.minimum or (self.exclusive and number == self.minimum)
            ):
                word = "more than" if self.exclusive else "at least"
                raise refusal(f"{value!r} is too small: it must be {word} {self.minimum:g}")
            return number

        return written_as_read(read, lambda value: write_quantity(value, self.dimension))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the quantity to an editor."""
        pattern = quantity_pattern(self.dimension)
        forms: list[dict[str, Any]] = [{"type": "string", "pattern": pattern}]
        if self.dimension is Dimension.RATIO:
            forms.append({"type": "number", "exclusiveMinimum": -1, "exclusiveMaximum": 1})
        elif not self.exclusive:
            forms.append({"const": 0})
        phrase = self.dimension.phrase.capitalize()
        return {
            "anyOf": forms,
            "description": f"{phrase} with its unit: {', '.join(UNITS[self.dimension])}.",
            "x-dimension": self.dimension.value,
        }


Duration = Annotated[float, QuantityOf(Dimension.TIME, minimum=0.0, exclusive=True)]
DurationOrZero = Annotated[float, QuantityOf(Dimension.TIME, minimum=0.0)]
Frequency = Annotated[float, QuantityOf(Dimension.FREQUENCY, minimum=0.0, exclusive=True)]
Length = Annotated[float, QuantityOf(Dimension.LENGTH)]
PositiveLength = Annotated[float, QuantityOf(Dimension.LENGTH, minimum=0.0, exclusive=True)]
Angle = Annotated[float, QuantityOf(Dimension.ANGLE)]
Speed = Annotated[float, QuantityOf(Dimension.SPEED)]
AngularSpeed = Annotated[float, QuantityOf(Dimension.ANGULAR_SPEED)]
Ratio = Annotated[float, QuantityOf(Dimension.RATIO, minimum=0.0)]
Size = Annotated[float, QuantityOf(Dimension.SIZE, minimum=0.0, exclusive=True)]
