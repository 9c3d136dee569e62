"""What the probe sends to the node: the lecture's examples, then random cases from the seed.

Each function returns messages as dicts of their fields. Angles are in radians.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Sequence

QUARTER = math.pi / 2.0


def axis_angle(seed: int) -> list[dict]:
    """Axes of length 1 and of any other length, with angles of any size."""
    chance = random.Random(f"{seed}/axis_angle")
    unit = [
        ((1.0, 0.0, 0.0), QUARTER),
        ((0.0, 1.0, 0.0), QUARTER),
        ((0.0, 0.0, 1.0), -QUARTER),
        ((0.0, 0.0, 1.0), math.pi),
        ((0.6, 0.0, -0.8), 0.0),
        ((0.0, 0.6, 0.8), 0.005),
        ((0.6, 0.8, 0.0), -0.0005),
        ((0.0, 1.0, 0.0), 5.0 * math.pi),
        ((0.8, 0.0, 0.6), -3.5 * math.pi),
        # Its largest part is 0, but it is no zero axis.
        ((-1.0, 0.0, 0.0), QUARTER),
    ]
    unit += [(_direction(chance), _angle(chance)) for _ in range(40)]
    other = [((1.0, 0.0, 1.0), QUARTER), ((0.0, 0.0, 2.0), QUARTER), ((1.0, 1.0, 1.0), 2.0)]
    # Its sum is 0, but it is no zero axis.
    other.append(((1.0, -1.0, 0.0), 1.2))
    # Short and long, but no zero axis.
    other += [(_scaled(_direction(chance), length), 2.2) for length in (0.01, 100.0)]
    for _ in range(44):
        length = 10.0 ** chance.uniform(-2.0, 2.0)
        other.append((_scaled(_direction(chance), length), _angle(chance)))
    return [_turn(axis, angle) for axis, angle in unit + other]


def rpy(seed: int) -> list[dict]:
    """Angles about the fixed axes x, y and z: single ones, then all at once."""
    chance = random.Random(f"{seed}/rpy")
    found = [(QUARTER, 0.0, 0.0), (0.0, QUARTER, 0.0), (0.0, 0.0, QUARTER), (0.1, 0.2, 0.3)]
    found += [(-4.0, 2.5, 9.0), (0.004, -0.002, 0.001), (math.pi, 0.0, -math.pi)]
    # Small, but no 0.
    found.append((-0.0006, 0.0005, 0.0004))
    found += [(_angle(chance), _angle(chance), _angle(chance)) for _ in range(52)]
    found += [
        (chance.uniform(-3.0, 3.0), pitch, chance.uniform(-3.0, 3.0))
        for pitch in 5 * (-QUARTER, QUARTER)
    ]
    return [_vector(angles) for angles in found]


def quaternion(seed: int) -> list[dict]:
    """Unit quaternions whose pitch is less than 85 degrees, of either sign."""
    chance = random.Random(f"{seed}/quaternion")
    half = math.sqrt(0.5)
    found = [(0.0, 0.0, 0.0, 1.0), (half, 0.0, 0.0, half), (0.0, 0.0, -half, half)]
    # Half a turn: w is 0, but it is no zero quaternion.
    found.append((1.0, 0.0, 0.0, 0.0))
    # Steep, but no gimbal lock: code that takes a sine of 0.99 for gimbal lock always fails.
    found += [_pitched(math.radians(pitch), chance) for pitch in (84.5, -84.5)]
    found += [_unit_quaternion(chance) for _ in range(54)]
    return [_quaternion(item) for item in found]


def scaled(seed: int) -> list[dict]:
    """Quaternions whose length is not 1."""
    chance = random.Random(f"{seed}/scaled")
    found = [(0.0, 0.0, 1.0, 1.0), (2.0, 0.0, 0.0, 2.0)]
    # Code that does not scale these computes a sine of the pitch of 8, or of 0.008.
    found += [_scaled(_pitched(pitch, chance), size) for pitch, size in ((1.0, 3.2), (-1.0, 0.1))]
    found += [
        _scaled(_unit_quaternion(chance), 10.0 ** chance.uniform(-1.0, 1.0)) for _ in range(26)
    ]
    return [_quaternion(item) for item in found]


def gimbal_lock(seed: int) -> list[dict]:
    """Quaternions with a pitch of 90 or -90 degrees and any roll and yaw, and some just short.

    They have length 1 but for rounding errors, which make the sine of the pitch a little less
    than 1 in some, and a little more in others. Short of it, roll and yaw are two angles still:
    code that takes a sine of 0.999 (87.4 degrees) or 0.9999 (89.2 degrees) for 1 loses one of them.
    """
    chance = random.Random(f"{seed}/gimbal_lock")
    half = math.sqrt(0.5)
    found = [(0.0, half, 0.0, half), (0.0, -half, 0.0, half)]
    less, more = [], []
    while min(len(less), len(more)) < 14:
        # Roll 0 and any yaw: at gimbal lock every rotation can be written so.
        turn = 0.5 * chance.uniform(-3.0, 3.0)
        pitch = chance.choice((-0.25, 0.25)) * math.pi
        values = (
            -math.sin(pitch) * math.sin(turn),
            math.sin(pitch) * math.cos(turn),
            math.cos(pitch) * math.sin(turn),
            math.cos(pitch) * math.cos(turn),
        )
        # Some nodes scale what has length 1 already, and so change the rounding errors.
        lengths = (1.0, math.hypot(*values), math.sqrt(sum(value * value for value in values)))
        sines = [_sine_of_pitch([value / length for value in values]) for length in lengths]
        if max(sines) < 1.0:
            less.append(values)
        elif min(sines) > 1.0:
            more.append(values)
    found += [one for pair in zip(less[:14], more[:14]) for one in pair]
    found += [
        _pitched(math.radians(pitch), chance)
        for pitch in (88.0, -88.0, 89.5, -89.5)
        for _ in range(2)
    ]
    return [_quaternion(item) for item in found]


def zero_axis(seed: int) -> list[dict]:
    """A zero axis, which says no rotation, among others that turn by much.

    So the answer to the message before is never right for a zero axis.
    """
    chance = random.Random(f"{seed}/zero_axis")
    found = []
    for angle in (0.0, QUARTER, -2.0):
        found += [((0.0, 0.0, 0.0), angle)]
        found += [(_direction(chance), chance.uniform(0.5, 2.5)) for _ in range(3)]
    return [_turn(axis, angle) for axis, angle in found]


def zero_quaternion(seed: int) -> list[dict]:
    """A quaternion of zeros, which is no rotation, among others that turn by much."""
    chance = random.Random(f"{seed}/zero_quaternion")
    found = []
    for _ in range(2):
        found += [(0.0, 0.0, 0.0, 0.0)]
        found += [_pitched(chance.uniform(-1.0, 1.0), chance) for _ in range(3)]
    return [_quaternion(item) for item in found]


def _direction(chance: random.Random) -> tuple[float, ...]:
    while True:
        vector = [chance.gauss(0.0, 1.0) for _ in range(3)]
        length = math.hypot(*vector)
        if length > 0.1:
            return tuple(value / length for value in vector)


def _angle(chance: random.Random) -> float:
    """A turn: usual, several times round, or tiny; of either sign."""
    kind = chance.random()
    if kind < 0.6:
        return chance.uniform(-math.pi, math.pi)
    if kind < 0.8:
        return chance.uniform(-8.0 * math.pi, 8.0 * math.pi)
    return chance.choice((-1.0, 1.0)) * 10.0 ** chance.uniform(-6.0, -1.0)


def _unit_quaternion(chance: random.Random) -> tuple[float, ...]:
    while True:
        values = [chance.gauss(0.0, 1.0) for _ in range(4)]
        length = math.hypot(*values)
        if length < 0.1:
            continue
        unit = tuple(value / length for value in values)
        if _sine_of_pitch(unit) < math.sin(math.radians(85.0)):
            return unit


def _pitched(pitch: float, chance: random.Random) -> tuple[float, ...]:
    """A unit quaternion with this pitch, in radians, and any roll and yaw but none near 0."""
    roll, yaw = (chance.choice((-1.0, 1.0)) * chance.uniform(0.5, 2.5) for _ in range(2))
    cr, sr = math.cos(roll / 2.0), math.sin(roll / 2.0)
    cp, sp = math.cos(pitch / 2.0), math.sin(pitch / 2.0)
    cy, sy = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _sine_of_pitch(values: Sequence[float]) -> float:
    """How large the sine of the pitch comes out, without its sign."""
    x, y, z, w = values
    return abs(2.0 * (w * y - z * x))


def _scaled(values: Iterable[float], factor: float) -> tuple[float, ...]:
    return tuple(factor * value for value in values)


def _turn(axis: Sequence[float], angle: float) -> dict:
    return {"data": [*axis, angle]}


def _vector(values: Sequence[float]) -> dict:
    return dict(zip("xyz", values, strict=True))


def _quaternion(values: Sequence[float]) -> dict:
    return dict(zip("xyzw", values, strict=True))
