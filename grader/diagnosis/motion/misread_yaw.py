"""A yaw that was read wrongly, found by which one the commands of a controller are right for."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

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


@dataclass(frozen=True)
class Reading:
    """A way to read yaw, from the true one in rad."""

    words: str
    mistake: str
    read: Callable[[float], float]

    def __str__(self) -> str:
        """What was seen, to follow a colon."""
        return f"it turns as if yaw were {self.words}"


_READINGS = (
    Reading("always 0", "yaw_of_another_order", lambda _: 0.0),
    Reading("in degrees", "yaw_in_degrees", math.degrees),
    Reading("half of the true yaw", "half_yaw", lambda yaw_rad: yaw_rad / 2.0),
    Reading("z of the quaternion", "z_for_yaw", lambda yaw_rad: math.sin(yaw_rad / 2.0)),
    Reading("the true yaw with the wrong sign", "negative_yaw", lambda yaw_rad: -yaw_rad),
    Reading(
        "always between -90° and 90°", "yaw_by_asin", lambda yaw_rad: math.asin(math.sin(yaw_rad))
    ),
)


def misread_yaw(run: Approach, position_m: float) -> Reading | None:
    """How yaw was read wrongly, if that alone explains the turns on the way to a goal.

    The commands then are in proportion to the direction of the goal less that yaw, and not in
    proportion to the direction less the true one.
    """
    scene = run.recording.scene
    limit_rad_s = scene.max_angular_rad_s if scene is not None else math.inf
    # A command may answer the newest odometry, or one that is some messages behind it.
    by_delay = [
        before_arrival(run, answers(run.recording, behind), position_m)
        for behind in range(MOST_BEHIND + 1)
    ]
    for pairs in by_delay:
        yaws_rad = [pair.pose.yaw_rad for pair in pairs]
        if len(pairs) < _LEAST_COMMANDS or max(yaws_rad) - min(yaws_rad) < _TURNED_RAD:
            return None
        if _r2(run, pairs, lambda yaw_rad: yaw_rad, limit_rad_s) > _RIGHT_R2:
            return None
    fits = [
        (_r2(run, pairs, reading.read, limit_rad_s), reading)
        for pairs in by_delay
        for reading in _READINGS
    ]
    r2, best = max(fits, key=lambda fit_of_reading: fit_of_reading[0])
    return best if r2 >= _GOOD_R2 else None


def _r2(
    run: Approach, pairs: Sequence[Answer], read: Callable[[float], float], limit_rad_s: float
) -> float:
    """How well the commands are in proportion to the error, wrapped or not; at most 1."""
    best = -math.inf
    for wrap in (wrap_angle, lambda error_rad: error_rad):
        samples = [
            Sample(
                wrap(run.direction_rad(pair.pose) - read(pair.pose.yaw_rad)),
                pair.command.twist.angular_rad_s,
            )
            for pair in pairs
        ]
        line = fit(samples, limit_rad_s)
        if line.gain > 0.0 and line.used >= _LEAST_COMMANDS:
            best = max(best, line.r2)
    return best
