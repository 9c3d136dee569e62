"""Coordinates in YAML: lists such as ``[1.5, 20 cm, 90 deg]``.

In a list of coordinates a bare number is metres (REP-103); an entry with a unit is
converted. An angle always needs its unit, for 1.5 may mean radians or degrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from pydantic import (
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainValidator,
    WithJsonSchema,
)
from pydantic_core import CoreSchema

from grader.spec.quantity import refusal, written_as_read
from grader.spec.unit import Dimension, parse_quantity
from sim.motion import Pose

MAX_COORDINATE_M = 10_000.0
"""Beyond it double precision no longer resolves a contact to a nanometre."""

_ANGLES = ("roll", "pitch", "yaw")

MIN_SIZE_M = 1e-6
"""What is smaller is a mistake, and its direction cannot be computed."""


def metres(value: Any, *, positive: bool = False) -> float:
    """Read a length: a bare number is metres.

    Args:
        positive: Whether it must be at least :data:`MIN_SIZE_M`.

    Raises:
        ValueError: It is not a length, not finite, absurdly large or too small.
    """
    number = math.nan
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        with suppress(ValueError):  # YAML 1.1 reads 1e3 as a string
            number = float(value)
    if not math.isfinite(number):
        if isinstance(value, float):
            raise ValueError(f"{value!r} is not finite")
        number = parse_quantity(value, Dimension.LENGTH)
    if abs(number) > MAX_COORDINATE_M:
        raise ValueError(
            f"{value!r} is too far away: at most {MAX_COORDINATE_M / 1000:g} km are simulated"
        )
    if positive and number < MIN_SIZE_M:
        least = "more than 0" if number <= 0.0 else f"at least {MIN_SIZE_M:g} m"
        raise ValueError(f"{value!r} is too small: it must be {least}")
    return number


@dataclass(frozen=True)
class Entries:
    """Pydantic annotation: a list of lengths, and of angles where the name is that of one.

    Attributes:
        optional: So many entries at the end may be left out; they are then zero.
        positive: Whether every length must be more than zero.
    """

    names: tuple[str, ...]
    make: Callable[..., Any] = lambda *numbers: numbers
    optional: int = 0
    positive: bool = False

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Validate entry by entry; written as it is read."""
        return written_as_read(self._read, self._write)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the list to an editor."""
        return {
            "type": "array",
            "items": {"type": ["number", "string"]},
            "minItems": len(self.names) - self.optional,
            "maxItems": len(self.names),
            "description": f"{self._form}: metres, or entries with their unit.",
            "x-words": f"`{self._form}`",
        }

    @property
    def _form(self) -> str:
        return f"[{', '.join(self.names)}]"

    def _read(self, value: Any) -> Any:
        if not isinstance(value, list | tuple):
            raise refusal(f"expected {self._form}, not {value!r}")
        least = len(self.names) - self.optional
        if not least <= len(value) <= len(self.names):
            needed = f"{least} to {len(self.names)}" if self.optional else f"{least}"
            raise refusal(f"expected {self._form}: {needed} entries, not {len(value)}")
        readers = [
            _angle if name in _ANGLES else partial(metres, positive=self.positive)
            for name in self.names
        ]
        numbers = [
            _refused(reader, item, f"{name}: ")
            for name, reader, item in zip(self.names, readers, value, strict=False)
        ]
        return self.make(*numbers, *[0.0] * (len(self.names) - len(numbers)))

    def _write(self, value: Any) -> list[float | str]:
        numbers = (value.x_m, value.y_m, value.yaw_rad) if isinstance(value, Pose) else value
        return [
            f"{number!r} rad" if name in _ANGLES else number
            for name, number in zip(self.names, numbers, strict=True)
        ]


def _refused(read: Callable[[Any], float], value: Any, place: str = "") -> float:
    """Read a number; a mistake becomes the message for the author of the YAML."""
    try:
        return read(value)
    except ValueError as error:
        raise refusal(f"{place}{error}") from None


def _angle(item: Any) -> float:
    if isinstance(item, int | float) and not isinstance(item, bool) and item:
        raise ValueError(f"{item!r} has no unit: write '{item} deg' or '{item} rad'")
    return parse_quantity(item, Dimension.ANGLE)


def _ends(x1: float, y1: float, x2: float, y2: float) -> tuple[float, ...]:
    if math.hypot(x2 - x1, y2 - y1) < MIN_SIZE_M:
        raise refusal("both ends are the same point")
    return x1, y1, x2, y2


def _rectangle(x_min: float, y_min: float, x_max: float, y_max: float) -> tuple[float, ...]:
    if x_min >= x_max or y_min >= y_max:
        raise refusal("expected [x_min, y_min, x_max, y_max]: each min must be less than its max")
    return x_min, y_min, x_max, y_max


def _pose(x_m: float, y_m: float, yaw_rad: float) -> Pose:
    return Pose(x_m, y_m, math.remainder(yaw_rad, math.tau))


_LENGTH = WithJsonSchema(
    {
        "type": ["number", "string"],
        "description": "Metres, or a length with its unit.",
        "x-words": "length, such as `0.2 m`; a bare number is in metres",
    }
)
Metres = Annotated[float, PlainValidator(lambda value: _refused(metres, value)), _LENGTH]
PositiveMetres = Annotated[
    float, PlainValidator(lambda value: _refused(partial(metres, positive=True), value)), _LENGTH
]
Point = Annotated[tuple[float, float], Entries(("x", "y"))]
Size = Annotated[tuple[float, float], Entries(("length", "width"), positive=True)]
Ends = Annotated[tuple[float, float, float, float], Entries(("x1", "y1", "x2", "y2"), _ends)]
Rectangle = Annotated[
    tuple[float, float, float, float], Entries(("x_min", "y_min", "x_max", "y_max"), _rectangle)
]
Position = Annotated[tuple[float, float, float], Entries(("x", "y", "z"))]
RollPitchYaw = Annotated[tuple[float, float, float], Entries(("roll", "pitch", "yaw"))]
PoseInPlane = Annotated[Pose, Entries(("x", "y", "yaw"), _pose)]
PoseOrPoint = Annotated[Pose, Entries(("x", "y", "yaw"), _pose, optional=1)]
