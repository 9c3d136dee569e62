"""A yaw that was read wrongly, found by which one the commands of a controller are right for."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from grader.findings.words import Words
from grader.measure.motion.approach import Approach
from grader.measure.motion.steering import (
    MOST_BEHIND,
    Answer,
    Sample,
    answers,
    before_arrival,
    fit,
)
from sim.motion import wrap_angle

# Chance does not come near it: nothing is read from fewer commands, or a worse fit.
_LEAST_COMMANDS = 20
_GOOD_R2 = 0.97
_RIGHT_R2 = 0.9
# Readings differ by less where the robot hardly turns.
_TURNED_RAD = 0.5
_FORMULA = "yaw = atan2(2 (w z + x y), 1 - 2 (y y + z z))"


@dataclass(frozen=True)
class Reading:
    """A way to read yaw, from the true one in rad."""

    words: str
    hint: str | Words
    of: Callable[[float], float]

    def __str__(self) -> str:
        """What was seen, to follow a colon."""
        return f"it turns as if yaw were {self.words}"


_READINGS = (
    Reading(
        "always 0",
        Words(
            python="The order of a quaternion in ROS is x, y, z, w. as_euler('xyz') and "
            "euler_from_quaternion() return roll, pitch and yaw: yaw is the last of the three. "
            f"{_FORMULA}. Compute it again in each callback: at the start it may have been 0.",
            cpp="The order of a quaternion in ROS is x, y, z, w. getRPY() of tf2::Matrix3x3 gives "
            "roll, pitch and yaw: yaw is the last of the three. "
            f"{_FORMULA}. Compute it again in each callback: at the start it may have been 0.",
        ),
        lambda _: 0.0,
    ),
    Reading(
        "in degrees",
        "Angles in ROS are in radians (REP-103), and so is atan2's result: do not convert them.",
        math.degrees,
    ),
    Reading(
        "half of the true yaw",
        f"A quaternion holds half of the angle: {_FORMULA}, or 2 * atan2(z, w) on flat ground.",
        lambda yaw_rad: yaw_rad / 2.0,
    ),
    Reading(
        "z of the quaternion",
        f"z alone is the sine of half the angle: {_FORMULA}.",
        lambda yaw_rad: math.sin(yaw_rad / 2.0),
    ),
    Reading(
        "the true yaw with the wrong sign",
        "Counter-clockwise is positive (REP-103), and 2 * asin(z) has the wrong sign when w is "
        f"negative: {_FORMULA}.",
        lambda yaw_rad: -yaw_rad,
    ),
    Reading(
        "always between -90° and 90°",
        f"asin and atan return angles from -90° to 90° only. Use atan2: {_FORMULA}.",
        lambda yaw_rad: math.asin(math.sin(yaw_rad)),
    ),
)


def misread_yaw(run: Approach, position_m: float) -> Reading | None:
    """How yaw was read wrongly, if that alone explains the turns on the way to a goal.

    The commands then are in proportion to the direction of the goal less that yaw, and not in
    proportion to the direction less the true one.
    """
    scene = run.recording.scene
    limit_rad_s = scene.max_angular_rad_s if scene is not None else math.inf
    ways = [
        before_arrival(run, answers(run.recording, behind), position_m)
        for behind in range(MOST_BEHIND + 1)
    ]
    for way in ways:
        yaws = [answer.pose.yaw_rad for answer in way]
        if len(way) < _LEAST_COMMANDS or max(yaws) - min(yaws) < _TURNED_RAD:
            return None
        if _r2(run, way, lambda yaw_rad: yaw_rad, limit_rad_s) > _RIGHT_R2:
            return None
    fits = [(_r2(run, way, one.of, limit_rad_s), one) for way in ways for one in _READINGS]
    r2, best = max(fits, key=lambda item: item[0])
    return best if r2 >= _GOOD_R2 else None


def _r2(
    run: Approach, way: Sequence[Answer], read: Callable[[float], float], limit_rad_s: float
) -> float:
    """How well the commands are in proportion to the error, wrapped or not; at most 1."""
    found = -math.inf
    for wrap in (wrap_angle, lambda error_rad: error_rad):
        samples = [
            Sample(
                wrap(run.direction_rad(item.pose) - read(item.pose.yaw_rad)),
                item.command.twist.angular_rad_s,
            )
            for item in way
        ]
        line = fit(samples, limit_rad_s)
        if line.gain > 0.0 and line.used >= _LEAST_COMMANDS:
            found = max(found, line.r2)
    return found
