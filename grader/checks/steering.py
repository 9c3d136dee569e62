"""Commands on the way to a goal pose and at it, each with the error that it answers."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from grader.checks.approach import NO_SPEED_M_S, Approach
from grader.checks.command import Command, commands, number, odometry
from grader.checks.law import Law, Sample, examine
from grader.checks.track import pose_at
from grader.recording.model import NS, Message
from sim.motion import Pose

LEAST_SAMPLES = 8
# A command is in force from the step after it.
_STEP_NS = 12_000_000
# Of what the law of the first phase asks for.
_SAME = 0.03
_GOOD_R2 = 0.9


@dataclass(frozen=True)
class Answer:
    """A command with what its sender can have known.

    Attributes:
        command: As published.
        seen_ns: When the odometry was measured that it answers.
        pose: The robot's then.
    """

    command: Command
    seen_ns: int
    pose: Pose


def answers(run: Approach, behind: int) -> list[Answer]:
    """Every command that knows an error.

    Args:
        run: The run.
        behind: By how many messages the student was behind the newest odometry.
    """
    told = odometry(run.recording)
    found = []
    for item in commands(run.recording):
        # What was sent before the first odometry, or after the end, knows no error.
        seen_ns = _seen_ns(told, item.time_ns, behind)
        if seen_ns is None or item.time_ns > run.truth[-1].time_ns or not item.twist.is_finite:
            continue
        found.append(Answer(item, seen_ns, pose_at(run.truth, seen_ns)))
    return found


def on_the_way(run: Approach, known: Sequence[Answer], position_m: float) -> list[Sample]:
    """Commands until the robot is near the goal, with the error to the goal's direction.

    Args:
        run: The run.
        known: As :func:`answers` finds them.
        position_m: How near.
    """
    arrival = run.arrival(position_m)
    arrival_ns = math.inf if arrival is None else run.truth[arrival].time_ns
    return [_to_goal(run, item) for item in known if item.seen_ns < arrival_ns]


def at_the_goal(
    run: Approach, known: Sequence[Answer], position_m: float, limit_rad_s: float
) -> list[Sample]:
    """Commands since the robot has stopped near the goal, with the error to its heading.

    One that drives on while it turns is judged by what it does since it arrived.

    Args:
        run: The run.
        known: As :func:`answers` finds them.
        position_m: How near.
        limit_rad_s: The robot's.
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


def _seen_ns(told: Sequence[Message], time_ns: int, behind: int) -> int | None:
    """Time at which the newest odometry that was known was measured, or None before the first."""
    if not told:
        return time_ns
    index = bisect_right(told, time_ns, key=_stamp_ns)
    if index <= behind:
        return None
    message = told[index - 1 - behind]
    sec, nanosec = (number(message.value, "header", "stamp", key) for key in ("sec", "nanosec"))
    return message.stamp_ns if sec is None or nanosec is None else int(sec) * NS + int(nanosec)


def _stamp_ns(message: Message) -> int:
    return message.stamp_ns
