"""Numbers that a message should be made of: fields of another message, or what follows of them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, TypeAdapter

from grader.checks.field import FieldPath, number_at
from grader.checks.value import leaves

_YAW = re.compile(r"yaw\((?P<path>.*)\)")
_PATH: TypeAdapter[str] = TypeAdapter(FieldPath)
_QUATERNION = ("x", "y", "z", "w")


@dataclass(frozen=True)
class SourceValue:
    """How a number follows from a message.

    Attributes:
        is_yaw: Whether it is the yaw of a quaternion, in radians.
    """

    text: str
    path: str
    is_yaw: bool

    @classmethod
    def of(cls, text: str) -> SourceValue:
        """Read ``twist.twist.linear.x`` or ``yaw(pose.pose.orientation)``.

        Raises:
            ValueError: It is neither.
        """
        match = _YAW.fullmatch(text)
        return cls(text, _PATH.validate_python(match["path"] if match else text), match is not None)

    @property
    def paths(self) -> tuple[str, ...]:
        """The fields that hold its numbers."""
        return tuple(f"{self.path}.{part}" for part in _QUATERNION) if self.is_yaw else (self.path,)

    def number(self, message: Mapping[str, Any]) -> float:
        """The number that follows from a message.

        Raises:
            NoSuchField: It has no such field.
        """
        if self.is_yaw:
            return yaw(*(number_at(message, path) for path in self.paths))
        return number_at(message, self.path)

    def error(self, observed: float, wanted: float) -> float:
        """How far a number is off; of angles the difference on the circle."""
        difference = observed - wanted
        if self.is_yaw and math.isfinite(difference):
            return math.remainder(difference, math.tau)
        return difference


def _readable(text: str) -> str:
    SourceValue.of(text)
    return text


SourceText = Annotated[str, AfterValidator(_readable)]


def yaw(x: float, y: float, z: float, w: float) -> float:
    """Heading of a quaternion: its rotation about the fixed z axis, in [-pi, pi].

    Source: REP-103, and the usual conversion to roll, pitch, yaw.
    """
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def mistakes(value: SourceValue, message: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """What students take instead of a value, with the number that it gives for a message.

    Yields:
        Words that end the sentence "it is ...", and the number; the same words in the same
        order for every message of a type, as far as its arrays have the same length.
    """
    right = value.number(message)
    if value.is_yaw:
        x, y, z, w = (number_at(message, path) for path in value.paths)
        for part, number in zip(_QUATERNION, (x, y, z, w), strict=True):
            yield f"`{part}` of the quaternion, which is no angle: convert the quaternion", number
        yield "the yaw in degrees: ROS has angles in radians (REP-103)", math.degrees(right)
        yield "the yaw with the wrong sign", -right
        yield "half of the yaw: atan2(z, w) is half of the angle", math.atan2(z, w)
        yield "asin(z), which is half of the yaw", math.asin(max(-1.0, min(1.0, z)))
        size = 2.0 * math.acos(max(-1.0, min(1.0, w)))
        yield "2 acos(w), which has lost the sign of the yaw", size
        doubled = 2.0 * math.asin(max(-1.0, min(1.0, z)))
        yield "2 asin(z), which is wrong where w is negative: math.atan2 knows both", doubled
        folded = math.atan(math.tan(right))
        yield "the yaw without its quadrant: math.atan2(a, b), not math.atan(a / b)", folded
        yield "the yaw from asin, which gives -90° to 90° only", math.asin(math.sin(right))
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        yield "the roll: the arguments of the conversion are in another order", roll
        pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
        yield "the pitch: the angles of the conversion are in another order", pitch
        yield (
            "the yaw of the quaternion with `w` in front: ROS has x, y, z, w",
            yaw(w, x, y, z),
        )
        yield "the yaw with the quaternion taken as w, x, y, z", yaw(y, z, w, x)
    else:
        yield f"`{value.path}` with the wrong sign", -right
        yield f"`{value.path}` without its sign, as of math.hypot() or abs()", abs(right)
        yield f"`{value.path}` in degrees: ROS has angles in radians (REP-103)", math.degrees(right)
        yield (
            f"100 times `{value.path}`, as in centimetres: ROS has metres (REP-103)",
            100.0 * right,
        )
        whole = f"`{value.path}` as a whole number, as of int(), round() or //"
        for rounded in (round, math.trunc, math.floor):
            yield whole, float(rounded(right)) if math.isfinite(right) else right
        for decimals, words in ((1, "one decimal"), (2, "two decimals")):
            yield f"`{value.path}` with {words} only, as of round()", round(right, decimals)
    for path, number in leaves(message).items():
        if path != value.path and isinstance(number, int | float):
            yield f"`{path}`", float(number)


def spread(numbers: Sequence[float]) -> float:
    """How much numbers vary."""
    return max(numbers) - min(numbers) if numbers else 0.0
