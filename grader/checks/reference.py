"""Parameters that are a number with its unit, or the name of a scenario's random value."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError

from grader.spec.name import ID
from grader.spec.nearest_name import did_you_mean
from grader.spec.quantity import refusal, written_as_read
from grader.spec.unit import Dimension, parse_quantity, write_quantity
from sim.coordinates import metres
from sim.motion import Pose, wrap_angle


class UnknownValue(ValueError):
    """A check names a random value that its scenario does not have."""

    def __init__(self, name: str, values: Mapping[str, float]) -> None:
        """Name the value, and the nearest that there is."""
        listed = f" There are: {', '.join(sorted(values))}." if values else " It has none."
        super().__init__(
            f"the scenario has no random value {name!r}." + (did_you_mean(name, values) or listed)
        )


def resolve(reference: float | str, values: Mapping[str, float]) -> float:
    """The number that a parameter stands for.

    Raises:
        UnknownValue: There is no value of this name.
    """
    if not isinstance(reference, str):
        return reference
    if reference not in values:
        raise UnknownValue(reference, values)
    return values[reference]


@dataclass(frozen=True)
class Goal:
    """Where the robot shall end, as the YAML gives it.

    Attributes:
        x: Metres, or the name of a random value.
        y: Metres, or the name of a random value.
        theta: Radians, or the name of a random value.
    """

    x: float | str
    y: float | str
    theta: float | str

    def pose(self, values: Mapping[str, float]) -> Pose:
        """The same in numbers, in the world's frame.

        Raises:
            UnknownValue: It names a value that is not among them.
        """
        x_m, y_m, theta_rad = (resolve(item, values) for item in (self.x, self.y, self.theta))
        return Pose(x_m, y_m, wrap_angle(theta_rad))


@dataclass(frozen=True)
class _Reference:
    """Pydantic annotation: a quantity or a name."""

    dimension: Dimension
    bare: bool = False

    def read(self, value: Any) -> float | str:
        """Read what the YAML has.

        Raises:
            PydanticCustomError: It is neither.
        """
        if isinstance(value, str) and re.fullmatch(ID, value):
            return value
        if isinstance(value, str) and value.startswith("$"):
            raise refusal(f"checks take the bare name of a random value: write {value[1:]!r}")
        try:
            if self.bare:
                return metres(value)
            return parse_quantity(value, self.dimension)
        except ValueError as error:
            raise refusal(f"{error}, or name a random value") from None

    def write(self, value: float | str) -> float | str:
        """What :meth:`read` reads again."""
        return value if isinstance(value, str) else write_quantity(value, self.dimension)

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Validate by :meth:`read`."""
        return written_as_read(self.read, self.write)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe it to an editor."""
        unit = {Dimension.LENGTH: "0.2 m", Dimension.ANGLE: "5 deg"}[self.dimension]
        return {
            "type": ["number", "string"] if self.bare else "string",
            "x-words": f"{self.dimension.value}, such as `{unit}`, or the name of a random value",
        }


_GOAL_ENTRIES = {
    "x": _Reference(Dimension.LENGTH, bare=True),
    "y": _Reference(Dimension.LENGTH, bare=True),
    "theta": _Reference(Dimension.ANGLE),
}


class _GoalAnnotation:
    """Pydantic annotation: a list of x, y and theta."""

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Validate entry by entry; written as it is read."""
        return written_as_read(self._read, self._write)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe it to an editor."""
        return {
            "type": "array",
            "items": {"type": ["number", "string"]},
            "minItems": 3,
            "maxItems": 3,
            "x-words": "[x, y, theta]: metres, and an angle with its unit; or names of random "
            "values",
        }

    def _read(self, value: Any) -> Goal:
        if isinstance(value, Goal):
            return value
        if not isinstance(value, list | tuple) or len(value) != len(_GOAL_ENTRIES):
            raise refusal(f"expected [x, y, theta], not {value!r}")
        entries = []
        for (name, reference), item in zip(_GOAL_ENTRIES.items(), value, strict=True):
            try:
                entries.append(reference.read(item))
            except PydanticCustomError as error:
                raise refusal(f"{name}: {error}") from None
        return Goal(*entries)

    def _write(self, goal: Goal) -> list[float | str]:
        pairs = zip(_GOAL_ENTRIES.values(), (goal.x, goal.y, goal.theta), strict=True)
        return [reference.write(item) for reference, item in pairs]


GoalPose = Annotated[Goal, _GoalAnnotation()]
