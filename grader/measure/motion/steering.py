"""Commands on the way to a goal pose and at it, each with the error that it answers."""

from __future__ import annotations

import math
from collections.abc import Sequence

from grader.measure.motion.answer import Answer
from grader.measure.motion.approach import NO_SPEED_M_S, Approach
from grader.measure.motion.control_law import Law, Sample, examine

LEAST_SAMPLES = 8
# A command is in force from the step after it.
_STEP_NS = 12_000_000
# Of what the law of the first phase asks for.
_SAME = 0.03
_GOOD_R2 = 0.9


def on_the_way(run: Approach, known: Sequence[Answer], position_m: float) -> list[Sample]:
    """Commands until the robot is near the goal, with the error to the goal's direction."""
    return [_to_goal(run, item) for item in before_arrival(run, known, position_m)]


def before_arrival(run: Approach, known: Sequence[Answer], position_m: float) -> list[Answer]:
    """Commands that answer where the robot was before it was near the goal."""
    arrival = run.arrival(position_m)
    arrival_ns = math.inf if arrival is None else run.truth[arrival].time_ns
    return [item for item in known if item.seen_ns < arrival_ns]


def at_the_goal(
    run: Approach, known: Sequence[Answer], position_m: float, limit_rad_s: float
) -> list[Sample]:
    """Commands since the robot has stopped near the goal, with the error to its heading.

    One that drives on while it turns is judged by what it does since it arrived.
    """
    arrival, driven = run.arrival(position_m), run.driven(position_m)
    since_ns: float
    if driven is not None:
        since_ns = run.truth[driven].time_ns - _STEP_NS
    else:
        since_ns = math.inf if arrival is None else run.truth[arrival].time_ns
    there = [item for item in known if item.command.time_ns >= since_ns]
    still = [item for item in there if abs(item.command.twist.linear_m_s) <= NO_SPEED_M_S]
    still = still[_of_the_way(run, known, still, position_m, limit_rad_s) :]
    if len(still) >= LEAST_SAMPLES:
        return [_to_heading(run, item) for item in still]
    driving = [item for item in there if abs(item.command.twist.linear_m_s) > NO_SPEED_M_S]
    return [_to_heading(run, item) for item in (*driving, *still)]


def _of_the_way(
    run: Approach,
    known: Sequence[Answer],
    still: Sequence[Answer],
    position_m: float,
    limit_rad_s: float,
) -> int:
    """How many of the first commands without speed still turn to the goal's direction.

    Near the goal its direction changes fast; one that drives only where it looks there then
    stops and turns once more, before it has arrived by its own tolerance.
    """
    way = on_the_way(run, known, position_m)
    law = examine(way, limit_rad_s, _GOOD_R2)
    if law.law is not Law.PROPORTIONAL or law.r2 < _GOOD_R2:
        return 0
    fastest = max(abs(sample.command_rad_s) for sample in way)
    for index, item in enumerate(still):
        sample = _to_goal(run, item)
        wanted = max(-fastest, min(fastest, law.gain * sample.error_rad))
        if abs(sample.command_rad_s - wanted) > _SAME * abs(wanted):
            return index
    return 0


def _to_goal(run: Approach, item: Answer) -> Sample:
    return Sample(run.bearing_error_rad(item.pose), item.command.twist.angular_rad_s)


def _to_heading(run: Approach, item: Answer) -> Sample:
    return Sample(run.heading_error_rad(item.pose), item.command.twist.angular_rad_s)
