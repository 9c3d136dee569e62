"""Parameters that are a number with its unit, or the name of a scenario's value."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Annotated, Any

from pydantic import PlainSerializer, PlainValidator, WithJsonSchema

from grader.spec.name import ID
from grader.spec.nearest_name import did_you_mean
from grader.spec.quantity import refusal
from grader.spec.unit import Dimension, parse_quantity, write_quantity
from sim.coordinates import metres
from sim.motion import Pose, wrap_angle


class UnknownValue(ValueError):
    """A check names a value that its scenario does not have."""

    def __init__(self, name: str, values: Mapping[str, float]) -> None:
        listed = f" There are: {', '.join(sorted(values))}." if values else " It has none."
        super().__init__(
            f"the scenario has no value {name!r}." + (did_you_mean(name, values) or listed)
        )


@dataclass(frozen=True)
class Goal:
    """Where the robot shall end, as the YAML gives it.

    Attributes:
        x: Metres, or the name of a value of the scenario; so is ``y``.
        theta: Radians, or the name of such a value.
    """

    x: float | str
    y: float | str
    theta: float | str

    @property
    def names(self) -> tuple[str, ...]:
        """The values that it names."""
        return tuple(one for one in astuple(self) if isinstance(one, str))

    def pose(self, values: Mapping[str, float]) -> Pose:
        """The same in numbers, in the world's frame.

        Raises:
            UnknownValue: It names a value that is not among them.
        """
        for name in self.names:
            if name not in values:
                raise UnknownValue(name, values)
        x_m, y_m, theta_rad = (
            values[item] if isinstance(item, str) else item for item in astuple(self)
        )
        return Pose(x_m, y_m, wrap_angle(theta_rad))


def _read(value: Any) -> Goal:
    if isinstance(value, Goal):
        return value
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise refusal(f"expected [x, y, theta], not {value!r}")
    return Goal(*map(_entry, ("x", "y", "theta"), value))


def _entry(name: str, value: Any) -> float | str:
    if isinstance(value, str) and re.fullmatch(ID, value):
        return value
    if isinstance(value, str) and value.startswith("$"):
        text = f"checks take the bare name of a value: write {value[1:]!r}"
        raise refusal(f"{name}: {text}")
    try:
        return parse_quantity(value, Dimension.ANGLE) if name == "theta" else metres(value)
    except ValueError as error:
        raise refusal(f"{name}: {error}, or name a value of the scenario") from None


def _write(goal: Goal) -> list[float | str]:
    return [
        item if isinstance(item, str) else write_quantity(item, dimension)
        for item, dimension in zip(
            astuple(goal), (Dimension.LENGTH, Dimension.LENGTH, Dimension.ANGLE), strict=True
        )
    ]


GoalPose = Annotated[
    Goal,
    PlainValidator(_read),
    PlainSerializer(_write, when_used="json-unless-none"),
    WithJsonSchema(
        {
            "type": "array",
            "items": {"type": ["number", "string"]},
            "minItems": 3,
            "maxItems": 3,
            "x-words": "[x, y, theta]: metres, and an angle with its unit; or names of "
            "values of the scenario",
        }
    ),
]
