"""Coordinates in YAML: lists such as ``[1.5, 20 cm, 90 deg]``.

In a list of coordinates a bare number is metres (REP-103); an entry with a unit is
converted. An angle always needs its unit, for nobody can tell whether 1.5 meant radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from grader.spec.quantity import refusal, written_as_read
from grader.spec.unit import Dimension, parse_quantity
from sim.motion import Pose

MAX_COORDINATE_M = 10_000.0
"""Beyond it double precision no longer resolves a contact to a nanometre."""


MIN_SIZE_M = 1e-6
"""What is smaller is a mistake, and its direction cannot be computed."""


def metres(value: Any) -> float:
    """Read a length: a bare number is metres.

    Raises:
        ValueError: It is not a length, not finite or absurdly large.
    """
    number: float
    if isinstance(value, int | float) and not isinstance(value, bool):
        number = float(value)
        if not math.isfinite(number):
            raise ValueError(f"{value!r} is not finite")
    else:
        try:  # YAML 1.1 reads 1e3 as a string
            number = float(value) if isinstance(value, str) else math.nan
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            number = parse_quantity(value, Dimension.LENGTH)
    if abs(number) > MAX_COORDINATE_M:
        raise ValueError(
            f"{value!r} is too far away: at most {MAX_COORDINATE_M / 1000:g} km are simulated"
        )
    return number


@dataclass(frozen=True)
class Metres:
    """Pydantic annotation: a length in metres, a bare number is allowed.

    Attributes:
        positive: Whether it must be more than zero.
    """

    positive: bool = False

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Validate by :func:`metres`."""

        def read(value: Any) -> float:
            try:
                number = metres(value)
            except ValueError as error:
                raise refusal(str(error)) from None
            if self.positive and number < MIN_SIZE_M:
                raise refusal(_too_small(value, number))
            return number

        return core_schema.no_info_plain_validator_function(read)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the length to an editor."""
        return {
            "type": ["number", "string"],
            "description": "Metres, or a length with its unit.",
            "x-words": "length, such as `0.2 m`; a bare number is in metres",
        }


@dataclass(frozen=True)
class Entries:
    """Pydantic annotation: a list with named entries.

    Attributes:
        names: What each entry is; one called ``yaw`` is an angle, all others are lengths.
        optional: So many entries at the end may be left out; they are then zero.
        positive: Whether every length must be more than zero.
    """

    names: tuple[str, ...]
    make: Callable[..., Any]
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
        numbers = [self._entry(name, item) for name, item in zip(self.names, value, strict=False)]
        return self.make(*numbers, *[0.0] * (len(self.names) - len(numbers)))

    def _write(self, value: Any) -> list[float | str]:
        if isinstance(value, Pose):
            return [value.x_m, value.y_m, f"{value.yaw_rad!r} rad"]
        return list(value)

    def _entry(self, name: str, item: Any) -> float:
        try:
            if name == "yaw":
                return _angle(item)
            number = metres(item)
        except ValueError as error:
            raise refusal(f"{name}: {error}") from None
        if self.positive and number < MIN_SIZE_M:
            raise refusal(f"{name}: {_too_small(item, number)}")
        return number


def _too_small(item: Any, number: float) -> str:
    least = "more than 0" if number <= 0.0 else f"at least {MIN_SIZE_M:g} m"
    return f"{item!r} is too small: it must be {least}"


def _angle(item: Any) -> float:
    if isinstance(item, int | float) and not isinstance(item, bool) and item:
        raise ValueError(f"{item!r} has no unit: write '{item} deg' or '{item} rad'")
    return parse_quantity(item, Dimension.ANGLE)


def _tuple(*numbers: float) -> tuple[float, ...]:
    return numbers


def _pose(x_m: float, y_m: float, yaw_rad: float) -> Pose:
    return Pose(x_m, y_m, math.remainder(yaw_rad, math.tau))


PositiveMetres = Annotated[float, Metres(positive=True)]
Point = Annotated[tuple[float, float], Entries(("x", "y"), _tuple)]
Size = Annotated[tuple[float, float], Entries(("length", "width"), _tuple, positive=True)]
Ends = Annotated[tuple[float, float, float, float], Entries(("x1", "y1", "x2", "y2"), _tuple)]
Rectangle = Annotated[
    tuple[float, float, float, float], Entries(("x_min", "y_min", "x_max", "y_max"), _tuple)
]
PoseInPlane = Annotated[Pose, Entries(("x", "y", "yaw"), _pose)]
PoseOrPoint = Annotated[Pose, Entries(("x", "y", "yaw"), _pose, optional=1)]
