"""The classic mistakes in converting rotations, each as the formula that it makes.

Where the answers of wrong cases are what such a formula gives, the mistake has a name.
Formulas: https://en.wikipedia.org/wiki/Conversion_between_quaternions_and_Euler_angles
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from grader.findings.words import Words

from .conversion import (
    Rows,
    angles_between,
    oracle,
    rotations_of_answers,
    rotations_of_rpy,
    unit_quaternions,
)

Flags = NDArray[np.bool_]

# Share of the wrong answers that a mistake must explain to be named.
_EXPLAINS = 0.9
# Of a component of a quaternion, in addition to the tolerance.
_COMPONENT = 1e-5
# Between an angle that is right and one that is not.
_ANGLE_RAD = 1e-3
_CONJUGATE = np.array((-1.0, -1.0, -1.0, 1.0))
_PITCH_MIRRORED = np.array((1.0, -1.0, 1.0))
_ANGLES = (
    ("roll", "atan2(2 (w x + y z), 1 - 2 (x x + y y))"),
    ("pitch", "asin(2 (w y - z x))"),
    ("yaw", "atan2(2 (w z + x y), 1 - 2 (y y + z z))"),
)
_HALF_HINT = (
    "A quaternion holds half of the angle: vector part = sin(angle / 2) times the unit axis, "
    "w = cos(angle / 2)."
)
_AXIS_HINT = Words(
    python="Divide the axis by its length, math.sqrt(x**2 + y**2 + z**2), before you use it.",
    cpp="Divide the axis by its length, std::sqrt(x * x + y * y + z * z), before you use it.",
)
_ORDER_HINT = Words(
    python="ROS writes a quaternion as x, y, z, w; many books and libraries put w first. Name the "
    "fields: Quaternion(x=..., y=..., z=..., w=...).",
    cpp="ROS writes a quaternion as x, y, z, w; many books and libraries put w first. Name the "
    "fields: q.x = ...; q.y = ...; q.z = ...; q.w = ...;",
)
_RADIANS_HINT = Words(
    python="Angles in ROS are in radians, and so are those of math.sin and math.atan2.",
    cpp="Angles in ROS are in radians, and so are those of std::sin and std::atan2.",
)
_FIXED_HINT = (
    "Fixed axes stand still while the body turns: first roll about x, then pitch about y, then yaw "
    "about z, so q = q_yaw * q_pitch * q_roll, in this order."
)
_HALF_ANGLES_HINT = Words(
    python="A quaternion holds half angles: math.sin(roll / 2).",
    cpp="A quaternion holds half angles: std::sin(roll / 2).",
)
_LENGTH_HINT = Words(
    python="Divide x, y, z and w by the length of the quaternion, "
    "math.sqrt(x**2 + y**2 + z**2 + w**2), before you use them.",
    cpp="Divide x, y, z and w by the length of the quaternion, "
    "std::sqrt(x * x + y * y + z * z + w * w), before you use them.",
)
_QUADRANT_HINT = Words(
    python="Use math.atan2(a, b) and not math.atan(a / b): only the two signs tell the quadrant.",
    cpp="Use std::atan2(a, b) and not std::atan(a / b): only the two signs tell the quadrant.",
)
_INVERSE_HINT = "The vector part of the quaternion has the wrong sign, so it turns backwards."
_SIGN_HINT = (
    "q and -q are the same rotation, but all four numbers change their signs together: leave w "
    "negative, without abs(), or negate x, y and z with it."
)


@dataclass(frozen=True)
class Mistake:
    """A classic mistake, as a formula.

    Attributes:
        formula: From questions, shape (n, k), to the answers that it gives, shape (n, l).
    """

    words: str
    hint: str | Words
    formula: Callable[[Rows], Rows]


def explain(
    conversion: str, questions: Rows, answers: Rows, tolerance_rad: float
) -> tuple[Mistake, float] | None:
    """The mistake that gives most of these answers, with their share, or None.

    Args:
        questions: Of the wrong cases, shape (n, k).
        answers: The wrong answers, finite, shape (n, l).
    """
    if not len(questions):
        return None
    best: tuple[Mistake, float] | None = None
    right = oracle(conversion, questions)
    for mistake in MISTAKES[conversion]:
        with np.errstate(all="ignore"):
            given = mistake.formula(questions)
        # Where the mistake does no harm, it explains nothing.
        explained = _same(given, answers, tolerance_rad) & ~_right(given, right, tolerance_rad)
        share = float(np.mean(explained))
        if share >= _EXPLAINS and (best is None or share > best[1]):
            best = (mistake, share)
    return best


def wrong_part(conversion: str, questions: Rows, answers: Rows) -> tuple[str, str] | None:
    """The only one of roll, pitch and yaw that is wrong, and what to try; None without one."""
    if conversion != "quaternion_to_rpy" or not len(questions):
        return None
    off = answers - rpy_of(unit_quaternions(questions))
    off = np.abs(np.remainder(off + np.pi, 2.0 * np.pi) - np.pi)
    bad = [index for index in range(3) if np.mean(off[:, index] > _ANGLE_RAD) > 1.0 - _EXPLAINS]
    if len(bad) != 1:
        return None
    name, formula = _ANGLES[bad[0]]
    others = " and ".join(other for other, _ in _ANGLES if other != name)
    return (
        f"{others} are right, the {name} is not",
        f"Compare term by term: {name} = {formula}. Use atan2(a, b), for asin and atan(a / b) give "
        "angles from -90 to 90 deg only.",
    )


def _same(given: Rows, answers: Rows, tolerance_rad: float) -> Flags:
    """Which answers are those that are given, row by row."""
    if answers.shape[1] != 4:
        return _apart(given, rotations_of_answers(answers)) <= tolerance_rad
    # Component by component: the length of the quaternion may be part of the mistake.
    size = np.maximum(1.0, np.linalg.norm(given, axis=1))
    off = np.minimum(np.abs(given - answers).max(axis=1), np.abs(given + answers).max(axis=1))
    return np.asarray(off <= (0.5 * tolerance_rad + _COMPONENT) * size)


def _right(given: Rows, right: Rows, tolerance_rad: float) -> Flags:
    """Which of the given answers are right ones."""
    good = _apart(given, right) <= tolerance_rad
    if given.shape[1] == 4:
        good &= np.abs(np.linalg.norm(given, axis=1) - 1.0) <= _COMPONENT
    return np.asarray(good)


def _apart(given: Rows, rotations: Rows) -> Rows:
    """Angle between given answers and rotations, row by row; infinite where none is given."""
    known = np.isfinite(given).all(axis=1)
    result = np.full(len(given), np.inf)
    for index in np.flatnonzero(known):
        one = rotations_of_answers(given[index : index + 1])
        result[index] = angles_between(one, rotations[index : index + 1])[0, 0]
    return result


# --- Axis and angle to quaternion -----------------------------------------------------------


def _turn(axis: Rows, sine_of: Rows, cosine_of: Rows) -> Rows:
    """Quaternion with these two angles (radians) as they stand, no half taken."""
    return np.column_stack((axis * np.sin(sine_of)[:, None], np.cos(cosine_of)))


def _axis(rows: Rows) -> Rows:
    with np.errstate(all="ignore"):
        return np.asarray(rows[:, :3] / np.linalg.norm(rows[:, :3], axis=1, keepdims=True))


def _half(rows: Rows) -> Rows:
    return np.asarray(0.5 * rows[:, 3])


def _right_quaternion(rows: Rows) -> Rows:
    return _turn(_axis(rows), _half(rows), _half(rows))


def _angle_scaled(factor: float) -> Callable[[Rows], Rows]:
    def formula(rows: Rows) -> Rows:
        return _right_quaternion(np.column_stack((rows[:, :3], factor * rows[:, 3])))

    return formula


def _angle_without_sign(rows: Rows) -> Rows:
    return _right_quaternion(np.column_stack((rows[:, :3], np.abs(rows[:, 3]))))


def _w_first(formula: Callable[[Rows], Rows]) -> Callable[[Rows], Rows]:
    """w, x, y, z in the fields x, y, z, w."""
    return lambda rows: formula(rows)[:, [3, 0, 1, 2]]


def _conjugate(formula: Callable[[Rows], Rows]) -> Callable[[Rows], Rows]:
    return lambda rows: formula(rows) * _CONJUGATE


def _w_without_sign(formula: Callable[[Rows], Rows]) -> Callable[[Rows], Rows]:
    def given(rows: Rows) -> Rows:
        rotations = formula(rows)
        return np.column_stack((rotations[:, :3], np.abs(rotations[:, 3])))

    return given


_AXIS_ANGLE = (
    Mistake(
        "the angle is not halved",
        _HALF_HINT,
        lambda rows: _turn(_axis(rows), rows[:, 3], rows[:, 3]),
    ),
    Mistake(
        "the axis is not normalized",
        _AXIS_HINT,
        lambda rows: _turn(rows[:, :3], _half(rows), _half(rows)),
    ),
    Mistake(
        "the angle is halved in the cosine only",
        _HALF_HINT,
        lambda rows: _turn(_axis(rows), rows[:, 3], _half(rows)),
    ),
    Mistake(
        "the angle is halved in the sine only",
        _HALF_HINT,
        lambda rows: _turn(_axis(rows), _half(rows), rows[:, 3]),
    ),
    Mistake("w has lost its sign", _SIGN_HINT, _w_without_sign(_right_quaternion)),
    Mistake("w stands first: the fields x, y, z, w hold w, x, y, z", _ORDER_HINT,
         _w_first(_right_quaternion)),
    # Before the conjugate: where the angle is negative it gives the same rotation.
    Mistake(
         "the angle has lost its sign", "A negative angle turns the other way: leave it negative, "
         "without abs().", _angle_without_sign),
    Mistake("it is the conjugate, the inverse rotation", _INVERSE_HINT,
         _conjugate(_right_quaternion)),
    Mistake("the angle is converted as if it came in degrees", _RADIANS_HINT,
         _angle_scaled(np.pi / 180.0)),
    Mistake("the angle is converted to degrees", _RADIANS_HINT, _angle_scaled(180.0 / np.pi)),
)  # fmt: skip


# --- Roll, pitch and yaw to quaternion ------------------------------------------------------


def _mixed(order: list[int]) -> Callable[[Rows], Rows]:
    return lambda rows: rotations_of_rpy(rows[:, order])


def _intrinsic(rows: Rows) -> Rows:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("XYZ", rows).as_quat()).reshape(-1, 4)


def _rpy_times(factors: float | Rows) -> Callable[[Rows], Rows]:
    return lambda rows: rotations_of_rpy(rows * factors)


def _scaled(
    times: Callable[[float], Callable[[Rows], Rows]], mistakes: Sequence[tuple[str, float, str | Words]]
) -> tuple[Mistake, ...]:
    """A factor on all angles: what is wrong, to follow "the angles are"; the factor; a hint."""
    return tuple(
        Mistake(f"the angles are {words}", hint, times(factor)) for words, factor, hint in mistakes
    )


_SWAPPED = (
    ("roll and yaw are swapped", [2, 1, 0]),
    ("roll and pitch are swapped", [1, 0, 2]),
    ("pitch and yaw are swapped", [0, 2, 1]),
)
_SWAP_HINT = "Roll turns about x, pitch about y, yaw about z, and the fields are x, y and z."

_RPY = (
    *(Mistake(words, _SWAP_HINT, _mixed(order)) for words, order in _SWAPPED),
    Mistake("it turns about the axes that turn with the body (intrinsic), not about fixed ones",
         _FIXED_HINT, _intrinsic),
    *_scaled(
        _rpy_times,
        (
            ("not halved", 2.0, _HALF_ANGLES_HINT),
            ("converted as if in degrees", np.pi / 180.0, _RADIANS_HINT),
            ("converted to degrees", 180.0 / np.pi, _RADIANS_HINT),
        ),
    ),
    Mistake("w stands first: the fields x, y, z, w hold w, x, y, z", _ORDER_HINT,
         _w_first(rotations_of_rpy)),
    # Before the conjugate: where w is negative it gives the same rotation.
    Mistake("w has lost its sign", _SIGN_HINT, _w_without_sign(rotations_of_rpy)),
    Mistake("it is the conjugate, the inverse rotation", _INVERSE_HINT,
         _conjugate(rotations_of_rpy)),
    Mistake("only the yaw is used", _SWAP_HINT, _rpy_times(np.array((0.0, 0.0, 1.0)))),
    Mistake("the pitch has the wrong sign", _SWAP_HINT, _rpy_times(_PITCH_MIRRORED)),
)  # fmt: skip


# --- Quaternion to roll, pitch and yaw ------------------------------------------------------


def rpy_of(quaternions: Rows) -> Rows:
    """Roll, pitch and yaw, shape (n, 3), by the textbook's formula for unit quaternions."""
    x, y, z, w = quaternions.T
    return np.column_stack(
        (
            np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )
    )


def _right_rpy(rows: Rows) -> Rows:
    return rpy_of(unit_quaternions(rows))


def _times(factors: float | Rows) -> Callable[[Rows], Rows]:
    return lambda rows: _right_rpy(rows) * factors


def _intrinsic_rpy(rows: Rows) -> Rows:
    # The inverse turns backwards: intrinsic angles are those of the inverse, with their signs.
    return np.asarray(-_right_rpy(rows * _CONJUGATE))


def _tangent(rows: Rows) -> Rows:
    """With the arc tangent of a quotient, which knows two quadrants only."""
    angles = _right_rpy(rows)
    for column in (0, 2):
        angles[:, column] = np.arctan(np.tan(angles[:, column]))
    return angles


def _reordered_rpy(order: Sequence[int], rows: Rows) -> Rows:
    return _right_rpy(rows)[:, order]


_TO_RPY = (
    *(
        Mistake(words, _SWAP_HINT, partial(_reordered_rpy, order))
        for words, order in _SWAPPED
    ),
    Mistake("the angles are those about axes that turn with the body (intrinsic), not about fixed "
         "ones", _FIXED_HINT, _intrinsic_rpy),
    Mistake("the quaternion is not scaled to length 1 before", _LENGTH_HINT, rpy_of),
    Mistake("the quaternion is read with w first", _ORDER_HINT,
         lambda rows: _right_rpy(rows[:, [1, 2, 3, 0]])),
    # Before the inverse: where w is negative it gives the same angles.
    Mistake("w is read without its sign", _SIGN_HINT,
         lambda rows: _right_rpy(np.column_stack((rows[:, :3], np.abs(rows[:, 3]))))),
    Mistake("it is the inverse rotation", "The conjugate of a quaternion turns backwards: look for "
         "a wrong sign.", lambda rows: _right_rpy(rows * _CONJUGATE)),
    Mistake("the pitch has the wrong sign", "The pitch is asin(2 (w y - z x)).",
         _times(_PITCH_MIRRORED)),
    Mistake("roll and yaw lose their quadrant", _QUADRANT_HINT, _tangent),
    *_scaled(
        _times,
        (
            ("in degrees", 180.0 / np.pi, _RADIANS_HINT),
            ("converted as if in degrees", np.pi / 180.0, _RADIANS_HINT),
            ("halved", 0.5, "atan2 and asin give the whole angle here; do not halve it."),
            ("doubled", 2.0, "atan2 and asin give the whole angle here; do not double it."),
        ),
    ),
)  # fmt: skip

MISTAKES = {
    "axis_angle_to_quaternion": _AXIS_ANGLE,
    "rpy_to_quaternion": _RPY,
    "quaternion_to_rpy": _TO_RPY,
}
