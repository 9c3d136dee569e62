"""Commands with the odometry that they answer."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from grader.measure.motion.command import VelocityCommand, commands, number, odometry
from grader.measure.motion.track import pose_at
from grader.recording.model import NS, Message, Recording
from sim.motion import Pose

MOST_BEHIND = 2
"""Messages of odometry that are on their way, or wait for a busy callback, at most."""


@dataclass(frozen=True)
class Answer:
    """A command with what its sender can have known."""

    command: VelocityCommand
    seen_ns: int
    pose: Pose


def answers(recording: Recording, behind: int) -> list[Answer]:
    """Every command that knows where the robot is."""
    told = odometry(recording)
    found = []
    for item in commands(recording):
        # What was sent before the first odometry, or after the end, knows no error.
        seen_ns = _seen_ns(told, item.time_ns, behind)
        if (
            seen_ns is None
            or item.time_ns > recording.truth[-1].time_ns
            or not item.twist.is_finite
        ):
            continue
        found.append(Answer(item, seen_ns, pose_at(recording.truth, seen_ns)))
    return found


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
