"""Conversions between ways to write a rotation: what is asked, and which rotation it is.

The oracle is :class:`scipy.spatial.transform.Rotation`. A rotation is compared as a rotation:
``q`` and ``-q`` are the same one, and at gimbal lock many angles are. Arrays hold one case per
row: an axis with its angle as ``(x, y, z, angle)``, fixed-axis angles as ``(roll, pitch, yaw)``,
a quaternion as ``(x, y, z, w)``; lengths without unit, angles in radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float64]

# A unit vector that was rounded to float32 is one still.
_UNIT = 1e-6
# Of the sine of the pitch from 1; a pitch of 90 deg within 0.003 deg.
_LOCKED = 1e-9


class Group(str, Enum):
    """What is special about a case."""

    ORDINARY = "ordinary"
    """Nothing: the axis or the quaternion has length 1."""
    SCALED = "scaled"
    """The axis or the quaternion has another length."""
    GIMBAL_LOCK = "gimbal_lock"
    """The pitch is 90 or -90 deg, so that roll and yaw turn about the same axis."""
    ZERO = "zero"
    """The axis or the quaternion has length 0, so that it says no rotation."""

    @property
    def words(self) -> str:
        """As people write it."""
        return self.value.replace("_", " ")


class WrongMessage(ValueError):
    """A message holds something that cannot be read as a rotation."""


@dataclass(frozen=True)
class Conversion:
    """One way to write a rotation, turned into another."""

    asks: tuple[str, ...]
    answers: tuple[str, ...]
    group: Callable[[Sequence[float]], Group]
    shown: Callable[[Sequence[float]], str]


def _axis_angle_group(row: Sequence[float]) -> Group:
    length = math.hypot(*row[:3])
    if length == 0.0:
        return Group.ZERO
    return Group.ORDINARY if abs(length - 1.0) <= _UNIT else Group.SCALED


def _rpy_group(row: Sequence[float]) -> Group:
    return Group.GIMBAL_LOCK if _locks(math.sin(row[1])) else Group.ORDINARY


def _quaternion_group(row: Sequence[float]) -> Group:
    length = math.hypot(*row)
    if length == 0.0:
        return Group.ZERO
    if _locks(sine_of_pitch([value / length for value in row])):
        return Group.GIMBAL_LOCK
    return Group.ORDINARY if abs(length - 1.0) <= _UNIT else Group.SCALED


def sine_of_pitch(row: Sequence[float]) -> float:
    """Sine of the pitch of a unit quaternion (x, y, z, w)."""
    x, y, z, w = row
    return 2.0 * (w * y - z * x)


def _locks(sine: float) -> bool:
    return 1.0 - abs(sine) <= _LOCKED


def number(value: float) -> str:
    """A number as people read it, with four digits."""
    return f"{value + 0.0:.4g}"


def degrees(angle_rad: float) -> str:
    """An angle as people read it."""
    return f"{number(math.degrees(angle_rad))} deg"


def _axis_angle_words(row: Sequence[float]) -> str:
    axis = ", ".join(map(number, row[:3]))
    return f"{degrees(row[3])} about ({axis})"


def _rpy_words(row: Sequence[float]) -> str:
    return ", ".join(
        f"{name} {degrees(value)}"
        for name, value in zip(("roll", "pitch", "yaw"), row, strict=True)
    )


def _quaternion_words(row: Sequence[float]) -> str:
    return ", ".join(f"{name} = {number(value)}" for name, value in zip("xyzw", row, strict=True))


_QUATERNION = ("x", "y", "z", "w")
_VECTOR = ("x", "y", "z")

CONVERSIONS = {
    "axis_angle_to_quaternion": Conversion(
        tuple(f"data[{index}]" for index in range(4)),
        _QUATERNION,
        _axis_angle_group,
        _axis_angle_words,
    ),
    "rpy_to_quaternion": Conversion(_VECTOR, _QUATERNION, _rpy_group, _rpy_words),
    "quaternion_to_rpy": Conversion(_QUATERNION, _VECTOR, _quaternion_group, _quaternion_words),
}


def answer_words(answer: Sequence[float]) -> str:
    """An answer in words: a quaternion, or three angles."""
    return _quaternion_words(answer) if len(answer) == len(_QUATERNION) else _rpy_words(answer)


def oracle(name: str, questions: Rows) -> Rows:
    """The right rotations as unit quaternions; the identity where an axis or one is zero."""
    from scipy.spatial.transform import Rotation

    if name == "axis_angle_to_quaternion":
        return _quaternions(
            Rotation.from_rotvec(_unit(questions[:, :3]) * questions[:, 3:]), len(questions)
        )
    if name == "rpy_to_quaternion":
        return rotations_of_rpy(questions)
    return unit_quaternions(questions)


def rotations_of_rpy(angles: Rows) -> Rows:
    """Unit quaternions, shape (n, 4), of fixed-axis roll, pitch and yaw, shape (n, 3)."""
    from scipy.spatial.transform import Rotation

    # Lower case is extrinsic to scipy: about the axes of the fixed frame, x first.
    return _quaternions(Rotation.from_euler("xyz", angles), len(angles))


def unit_quaternions(raw: Rows) -> Rows:
    """Quaternions scaled to length 1, shape (n, 4); of a zero one the identity."""
    result = _unit(raw)
    result[~raw.any(axis=1)] = (0.0, 0.0, 0.0, 1.0)
    return result


def _quaternions(rotations: Any, count: int) -> Rows:
    return np.asarray(rotations.as_quat(), dtype=np.float64).reshape(count, 4)


def _unit(vectors: Rows) -> Rows:
    """Vectors scaled to length 1; zero ones stay zero."""
    # Scaled by the largest component first: the square of a tiny one would be lost.
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    scaled = np.divide(vectors, largest, out=np.zeros_like(vectors), where=largest > 0.0)
    length = np.linalg.norm(scaled, axis=1, keepdims=True)
    unit: Rows = np.divide(scaled, length, out=np.zeros_like(scaled), where=length > 0.0)
    return unit


def rotations_of_answers(answers: Rows) -> Rows:
    """Unit quaternions, shape (n, 4), of finite answers: quaternions or three angles."""
    if answers.shape[1] == len(_QUATERNION):
        return unit_quaternions(answers)
    return rotations_of_rpy(answers)


def angles_between(ones: Rows, others: Rows) -> Rows:
    """Angle from each of n unit quaternions to each of m others, in [0, pi], shape (n, m).

    Exact also for tiny angles, where the arc cosine of a scalar product is not.
    """
    minus = np.linalg.norm(ones[:, None, :] - others[None, :, :], axis=2)
    plus = np.linalg.norm(ones[:, None, :] + others[None, :, :], axis=2)
    chord = np.minimum(minus, plus)
    # |p - q| = 2 sin(angle / 4) for unit quaternions that are `angle` apart.
    return np.asarray(4.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0)))
