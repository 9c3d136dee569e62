"""A place on a robot's route: a point, or a zone with straight sides."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import GetPydanticSchema
from pydantic_core.core_schema import no_info_after_validator_function

from grader.findings.words import point
from grader.recording.simulated import Truth
from sim.coordinates import Metres


@dataclass(frozen=True)
class Point:
    """A point in the world's frame; the robot is there when it is near."""

    x_m: float
    y_m: float

    def __str__(self) -> str:
        return point(self.x_m, self.y_m)

    @property
    def middle(self) -> Point:
        """The point itself."""
        return self

    @property
    def bounds(self) -> tuple[float, ...]:
        """Nothing: a point has none."""
        return ()

    def reach_m(self, near_m: float) -> float:
        """How near its middle the robot has to come, where ``near_m`` is near a point."""
        return near_m

    def has(self, step: Truth, near_m: float) -> bool:
        """Whether the robot is there."""
        return math.hypot(step.x_m - self.x_m, step.y_m - self.y_m) <= near_m


@dataclass(frozen=True)
class Zone:
    """A rectangle in the world's frame; the robot is there when its middle is inside."""

    x_min_m: float
    y_min_m: float
    x_max_m: float
    y_max_m: float

    def __str__(self) -> str:
        corners = point(self.x_min_m, self.y_min_m), point(self.x_max_m, self.y_max_m)
        return f"the zone from {' to '.join(corners)}"

    @property
    def middle(self) -> Point:
        """Its middle."""
        return Point((self.x_min_m + self.x_max_m) / 2.0, (self.y_min_m + self.y_max_m) / 2.0)

    @property
    def bounds(self) -> tuple[float, ...]:
        """As in YAML: x_min, y_min, x_max, y_max."""
        return self.x_min_m, self.y_min_m, self.x_max_m, self.y_max_m

    def reach_m(self, near_m: float) -> float:
        """How near its middle the robot is inside, from whichever side it comes."""
        return min(self.x_max_m - self.x_min_m, self.y_max_m - self.y_min_m) / 2.0

    def has(self, step: Truth, near_m: float) -> bool:
        """Whether the middle of the robot is inside."""
        return self.x_min_m <= step.x_m <= self.x_max_m and self.y_min_m <= step.y_m <= self.y_max_m


def _point_or_zone(numbers: tuple[float, ...]) -> Point | Zone:
    if len(numbers) == 2:
        return Point(*numbers)
    if len(numbers) == 4:
        return Zone(*numbers)
    raise ValueError("write a point as [x, y], a zone as [x_min, y_min, x_max, y_max]")


Place = Annotated[
    Point | Zone,
    GetPydanticSchema(
        lambda _, read: no_info_after_validator_function(_point_or_zone, read(tuple[Metres, ...]))
    ),
]
"""Written in YAML as the list of its numbers."""
