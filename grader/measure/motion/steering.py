"""Commands on the way to a goal pose and at it, each with the error that it answers."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from grader.measure.motion.approach import NO_SPEED_M_S, Approach
from grader.measure.motion.command import VelocityCommand, commands, number, odometry
from grader.measure.motion.control_law import Law, Sample, examine
from grader.measure.motion.track import pose_at
from grader.recording.model import NS, Message, Recording
from sim.motion import Pose

MOST_BEHIND = 2
"""Messages of odometry that are on their way, or wait for a busy callback, at most."""
LEAST_SAMPLES = 8
# A command is in force from the step after it.
_STEP_NS = 12_000_000
# Of what the law of the first phase asks for.
_SAME = 0.03
_GOOD_R2 = 0.9


@dataclass(frozen=True)
class Answer:
    """A command with the odometry that its sender can have known: its time and true pose."""

    command: VelocityCommand
    seen_ns: int
    pose: Pose


def answers(recording: Recording, behind: int) -> list[Answer]:
    """Every finite command between the first odometry and the end.

    Args:
        behind: How many messages older than the newest the known odometry is.
    """
    received = odometry(recording)
    found = []
    for item in commands(recording):
        seen_ns = _seen_ns(received, item.time_ns, behind) if received else item.time_ns
        is_judged = item.twist.is_finite and item.time_ns <= recording.truth[-1].time_ns
        if seen_ns is not None and is_judged:
            found.append(Answer(item, seen_ns, pose_at(recording.truth, seen_ns)))
    return found


def _seen_ns(received: Sequence[Message], time_ns: int, behind: int) -> int | None:
    """Time at which the newest known odometry was measured, or None before the first."""
    index = bisect_right(received, time_ns, key=lambda message: message.stamp_ns)
    if index <= behind:
        return None
    message = received[index - 1 - behind]
    sec, nanosec = (number(message.value, "header", "stamp", key) for key in ("sec", "nanosec"))
    return message.stamp_ns if sec is None or nanosec is None else int(sec) * NS + int(nanosec)


def before_arrival(run: Approach, known: Sequence[Answer], position_m: float) -> list[Answer]:
    """Commands that answer where the robot was before it was near the goal."""
    arrival = run.arrival(position_m)
    arrival_ns = math.inf if arrival is None else run.truth[arrival].time_ns
    return [item for item in known if item.seen_ns < arrival_ns]


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
    fastest = max(abs(sample.command_rad_s) for sample in way)
    for index, item in enumerate(still):
        sample = _to_goal(run, item)
        wanted = max(-fastest, min(fastest, law.gain * sample.error_rad))
        if abs(sample.command_rad_s - wanted) > _SAME * abs(wanted):
            return index
    return 0


def _to_goal(run: Approach, item: Answer) -> Sample:
    return Sample(run.bearing_error_rad(item.pose), item.command.twist.angular_rad_s)
