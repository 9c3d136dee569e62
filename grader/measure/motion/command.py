"""Velocity commands as the student published them, and what the robot told."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from grader.recording.model import Message, Recording
from sim.motion import Twist

_TOPIC = "/cmd_vel"


@dataclass(frozen=True)
class VelocityCommand:
    """A velocity command.

    Attributes:
        twist: What it asks of the robot; may be NaN or infinite.
        stray: Other fields of it that are not zero, such as ``linear.y``.
    """

    time_ns: int
    twist: Twist
    stray: tuple[str, ...] = ()


def command_topic(recording: Recording) -> str:
    """Name of the topic that the robot obeys."""
    return _TOPIC if recording.scene is None else recording.scene.command_topic


def odometry(recording: Recording) -> tuple[Message, ...]:
    """What the robot told of its odometry, oldest first."""
    return () if recording.scene is None else recording.on(recording.scene.odometry_topic)


def scans(recording: Recording) -> tuple[Message, ...]:
    """What the robot told of its scans, oldest first."""
    return () if recording.scene is None else recording.on(recording.scene.scan_topic)


def commands(recording: Recording) -> tuple[VelocityCommand, ...]:
    """Every readable command, oldest first; a TwistStamped counts like a Twist."""
    found = []
    for message in recording.on(command_topic(recording)):
        value = message.value.get("twist", message.value)
        linear, angular = number(value, "linear", "x"), number(value, "angular", "z")
        if linear is not None and angular is not None:
            stray = tuple(
                f"{part}.{axis}"
                for part, axis in (
                    ("linear", "y"), ("linear", "z"), ("angular", "x"), ("angular", "y"),
                )
                if number(value, part, axis)
            )  # fmt: skip
            found.append(VelocityCommand(message.stamp_ns, Twist(linear, angular), stray))
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
