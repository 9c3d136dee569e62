"""Velocity commands as the student published them, and what the robot published."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from grader.recording.model import Message, Recording
from sim.motion import Twist

_TOPIC = "/cmd_vel"
# Late steps are noted before they are done, at the stamp of the step before them.
_MARGIN_NS = 20_000_000


@dataclass(frozen=True)
class VelocityCommand:
    """A velocity command; its twist may be NaN or infinite."""

    time_ns: int
    twist: Twist


def command_topic(recording: Recording) -> str:
    """Name of the topic that the robot obeys."""
    return _TOPIC if recording.scene is None else recording.scene.command_topic


def odometry(recording: Recording) -> tuple[Message, ...]:
    """The robot's odometry, oldest first."""
    return () if recording.scene is None else recording.on(recording.scene.odometry_topic)


def scans(recording: Recording) -> tuple[Message, ...]:
    """The robot's scans, oldest first."""
    return () if recording.scene is None else recording.on(recording.scene.scan_topic)


def commands(recording: Recording) -> tuple[VelocityCommand, ...]:
    """Every readable command, oldest first; a TwistStamped counts like a Twist."""
    found = []
    for message in recording.on(command_topic(recording)):
        value = message.value.get("twist", message.value)
        linear, angular = number(value, "linear", "x"), number(value, "angular", "z")
        if linear is not None and angular is not None:
            found.append(VelocityCommand(message.stamp_ns, Twist(linear, angular)))
    return tuple(found)


def number(value: Any, *path: str) -> float | None:
    """A number deep in a message, or None where there is none."""
    for key in path:
        if not isinstance(value, Mapping) or key not in value:
            return None
        value = value[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value)


def is_zero(twist: Twist) -> bool:
    """Whether a command asks the robot to rest."""
    return math.isclose(twist.linear_m_s, 0.0) and math.isclose(twist.angular_rad_s, 0.0)


def stolen_s(recording: Recording, begin_ns: int, end_ns: int) -> float:
    """How much later the robot can have received a command because of the machine, at most.

    The student's waits for a CPU and the probe's lateness, and how late the simulator itself
    was with its sensors' messages.
    """
    late_s = [
        item.value or 0.0
        for item in recording.incidents
        if item.kind == "late" and begin_ns - _MARGIN_NS <= item.time_ns <= end_ns
    ]
    return recording.stolen_s(begin_ns, max(begin_ns, end_ns)) + max(late_s, default=0.0)
