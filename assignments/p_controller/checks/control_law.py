"""Which law the turns on the way to a goal and at it follow: in proportion, or what else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

from grader.measure.motion.approach import NO_SPEED_M_S, Approach
from grader.measure.motion.steering import (
    FEW_STRAYS,
    LEAST_FIT,
    ZERO_RAD_S,
    Answer,
    Sample,
    before_arrival,
    fit,
)

LEAST_SAMPLES = 8
_FEW_TURNS = 5
# Near zero the command may pause, near half a turn both senses are right.
_PAUSE_RAD = 0.15
_EITHER_WAY_RAD = 0.3
# An error that needs no turn, and one from which the law cannot be seen.
_SMALL_RAD = 0.1
_TINY_RAD = 0.02
_SLOW_RAD_S = 0.2
_MOST_SIZES = 4
# A command is in force from the step after it.
_STEP_NS = 12_000_000
# Of what the law of the first phase asks for.
_SAME = 0.03
_GOOD_R2 = 0.9


class Law(Enum):
    """What the commands follow."""

    PROPORTIONAL = auto()
    """A line through the origin describes them best, well or badly."""
    NOTHING_TO_DO = auto()
    """There was hardly an error, and hardly a command."""
    TOO_FEW = auto()
    ZERO = auto()
    STEPS = auto()
    NOT_NORMALISED = auto()
    WRONG_SIGN = auto()


@dataclass(frozen=True)
class LawVerdict:
    """A law with its figures.

    Attributes:
        gain: Slope of the line through the origin, in rad/s for each rad.
        r2: Coefficient of determination of that line, at most 1.
        values: For steps: the sizes of the commands, in rad/s.
        share: For an error that is not normalised: share of the commands that are a turn off.
    """

    law: Law
    gain: float = 0.0
    r2: float = 0.0
    used: int = 0
    values: tuple[float, ...] = ()
    share: float = 0.0


def examine(samples: Sequence[Sample], limit_rad_s: float, least_r2: float) -> LawVerdict:
    """Find the law behind commands.

    Args:
        samples: In the order of time; finite.
        limit_rad_s: What the robot can do; larger commands say little of the law.
    """
    turning = [item for item in samples if _is_turning(item)]
    largest_rad = max((abs(item.error) for item in samples), default=math.inf)
    fastest_rad_s = max((abs(item.command) for item in samples), default=0.0)
    if (largest_rad <= _SMALL_RAD and len(turning) < _FEW_TURNS) or (
        largest_rad <= _TINY_RAD and fastest_rad_s <= _SLOW_RAD_S
    ):
        return LawVerdict(Law.NOTHING_TO_DO, used=len(samples))
    if len(samples) < LEAST_FIT:
        return LawVerdict(Law.TOO_FEW, used=len(samples))
    if not turning:
        return LawVerdict(Law.ZERO, used=len(samples))
    steps = _steps(turning)
    if steps:
        return LawVerdict(Law.STEPS, used=len(turning), values=steps)
    # Near half a turn the error may be read with either sign: take that of the command.
    judged = [
        _full_turn_off(item)
        if abs(item.error) > math.pi - _EITHER_WAY_RAD and _is_away(item)
        else item
        for item in samples
        if _is_turning(item) or abs(item.error) > _PAUSE_RAD
    ]
    wrong = sum(_is_wrong(item) for item in judged) / len(judged)
    best = fit(judged, limit_rad_s)
    if wrong <= FEW_STRAYS:
        return LawVerdict(Law.PROPORTIONAL, best.gain, best.r2, best.used)
    turned = fit([_full_turn_off(one) if _is_wrong(one) else one for one in judged], limit_rad_s)
    mirrored = fit([Sample(-one.error, one.command) for one in judged], limit_rad_s)
    if turned.gain > 0.0 and turned.r2 >= max(0.8 * least_r2, mirrored.r2):
        return LawVerdict(Law.NOT_NORMALISED, turned.gain, turned.r2, turned.used, share=wrong)
    if mirrored.gain > 0.0 and wrong > 0.5:
        return LawVerdict(Law.WRONG_SIGN, -mirrored.gain, mirrored.r2, mirrored.used)
    # The line of those that turn the right way, with no merit for the others.
    return LawVerdict(Law.PROPORTIONAL, best.gain, min(best.r2, 1.0 - wrong - least_r2), best.used)


def _is_turning(item: Sample) -> bool:
    return abs(item.command) > ZERO_RAD_S


def _is_away(item: Sample) -> bool:
    return item.error * item.command < 0.0


def _is_wrong(item: Sample) -> bool:
    """Whether it clearly turns away from the error."""
    size = abs(item.error)
    return _PAUSE_RAD < size < math.pi - _EITHER_WAY_RAD and _is_turning(item) and _is_away(item)


def _full_turn_off(item: Sample) -> Sample:
    """The same command for the error with the other sign, a full turn off."""
    return Sample(item.error - math.copysign(math.tau, item.error), item.command)


def _steps(turning: Sequence[Sample]) -> tuple[float, ...]:
    """The few sizes that all commands have, or nothing where they have many.

    A clamp gives the largest size again and again; below it a line has every size once.
    """
    sizes = [float(f"{abs(item.command):.3g}") for item in turning]
    distinct = tuple(sorted(set(sizes)))
    below = sum(size < distinct[-1] for size in sizes)
    few = len(distinct) <= _MOST_SIZES and len(sizes) > 2 * len(distinct)
    return distinct if few and (not below or below > 2 * (len(distinct) - 1)) else ()


def on_the_way(run: Approach, known: Sequence[Answer], position_m: float) -> list[Sample]:
    """Commands until the robot is near the goal, with the error to the goal's direction."""
    return [_to_goal(run, item) for item in before_arrival(run, known, position_m)]


def at_the_goal(
    run: Approach, known: Sequence[Answer], position_m: float, limit_rad_s: float
) -> list[Sample]:
    """Commands since the robot has stopped near the goal, with the error to its heading.

    A robot that drives on while it turns is judged by what it does since it arrived.
    """
    arrival, driven = run.arrival(position_m), run.driven(position_m)
    since_ns: float = math.inf
    if driven is not None:
        since_ns = run.truth[driven].time_ns - _STEP_NS
    elif arrival is not None:
        since_ns = run.truth[arrival].time_ns
    there = [item for item in known if item.command.time_ns >= since_ns]
    driving = [item for item in there if abs(item.command.twist.linear_m_s) > NO_SPEED_M_S]
    still = [item for item in there if abs(item.command.twist.linear_m_s) <= NO_SPEED_M_S]
    still = still[_of_the_way(run, on_the_way(run, known, position_m), still, limit_rad_s) :]
    judged = still if len(still) >= LEAST_SAMPLES else [*driving, *still]
    return [
        Sample(run.heading_error_rad(item.pose), item.command.twist.angular_rad_s)
        for item in judged
    ]


def _of_the_way(
    run: Approach, way: Sequence[Sample], still: Sequence[Answer], limit_rad_s: float
) -> int:
    """How many of the first commands without speed still turn to the goal's direction.

    Near the goal its direction changes fast; a robot that drives only where it looks there then
    stops and turns once more, before it has arrived by its own tolerance.
    """
    law = examine(way, limit_rad_s, _GOOD_R2)
    if law.law is not Law.PROPORTIONAL or law.r2 < _GOOD_R2:
        return 0
    fastest = max(abs(sample.command) for sample in way)
    for index, item in enumerate(still):
        sample = _to_goal(run, item)
        wanted = max(-fastest, min(fastest, law.gain * sample.error))
        if abs(sample.command - wanted) > _SAME * abs(wanted):
            return index
    return 0


def _to_goal(run: Approach, item: Answer) -> Sample:
    return Sample(run.bearing_error_rad(item.pose), item.command.twist.angular_rad_s)
