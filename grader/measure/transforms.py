"""Transforms between frames, as messages have them (REP-103, REP-105)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grader.recording.model import NS, Message, Recording

TRANSFORMS = "tf2_msgs/msg/TFMessage"
Numbers = tuple[float, ...]
"""x, y, z; roll, pitch, yaw; or a quaternion x, y, z, w."""
Pose = tuple[Numbers, Numbers]
"""A place in metres, and a quaternion."""

# What tf2 takes for a quaternion of length 1 (tf2/src/buffer_core.cpp).
_UNIT = 1e-2
_LONGEST_NAME = 100
_PARTS = (("translation", "rotation"), ("position", "orientation"))


@dataclass(frozen=True)
class Sent:
    """A transform as it was published.

    Attributes:
        pose: Where the child is in its parent, as :func:`pose_of` says it.
        stamp_ns: Of its header.
    """

    parent: str
    child: str
    pose: Pose
    stamp_ns: int
    message: Message

    @property
    def is_valid(self) -> bool:
        """Whether tf2 takes it: finite, and its quaternion has the length 1."""
        place, turn = self.pose
        length = math.fsum(part * part for part in turn)
        return abs(length - 1.0) <= _UNIT and all(map(math.isfinite, place))


def sent(recording: Recording, topics: Iterable[str]) -> Iterator[Sent]:
    """The transforms on some topics, in the order of their publishing on each."""
    for message in (one for topic in topics for one in recording.on(topic)):
        for one in message.value["transforms"] if message.type == TRANSFORMS else ():
            names = (one["header"]["frame_id"], one["child_frame_id"])
            parent, child = (name[:_LONGEST_NAME] for name in names)
            pose, stamp_ns = pose_of(one), stamp_of(one)
            assert pose is not None and stamp_ns is not None, one
            yield Sent(parent, child, pose, stamp_ns, message)


def pose_of(message: Mapping[str, Any]) -> Pose | None:
    """The first pose or transform in a message."""
    for place, turn in _PARTS:
        if place in message and turn in message:
            return (
                tuple(message[place][axis] for axis in "xyz"),
                tuple(message[turn][axis] for axis in "xyzw"),
            )
    if {"x", "y", "theta"} <= message.keys():
        return (message["x"], message["y"], 0.0), quaternion(0.0, 0.0, message["theta"])
    inner = (pose_of(item) for item in message.values() if isinstance(item, Mapping))
    return next((one for one in inner if one is not None), None)


def stamp_of(message: Mapping[str, Any]) -> int | None:
    """The stamp in a message's header in nanoseconds, or None where it has none."""
    header = message.get("header")
    stamp = header.get("stamp") if isinstance(header, Mapping) else None
    return stamp["sec"] * NS + stamp["nanosec"] if isinstance(stamp, Mapping) else None


def quaternion(roll: float, pitch: float, yaw: float) -> Numbers:
    """Of a rotation about the parent's x, then y, then z axis."""
    a, b, c = (math.sin(angle / 2.0) for angle in (roll, pitch, yaw))
    i, j, k = (math.cos(angle / 2.0) for angle in (roll, pitch, yaw))
    return (
        a * j * k - i * b * c,
        i * b * k + a * j * c,
        i * j * c - a * b * k,
        i * j * k + a * b * c,
    )


def roll_pitch_yaw(rotation: Numbers) -> Numbers:
    """The angles of a quaternion of length 1."""
    x, y, z, w = rotation
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x)))),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def angle_between(one: Numbers, other: Numbers) -> float:
    """By how much two rotations differ; a quaternion and its negative are the same."""
    cosine = math.fsum(a * b for a, b in zip(one, other, strict=True))
    return 2.0 * math.acos(min(1.0, abs(cosine)))


def roots(transforms: Sequence[Sent]) -> list[str]:
    """Where the ways from all frames to their parents end; of a circle, one of its frames."""
    parents = {one.child: one.parent for one in reversed(transforms)}
    found: dict[str, str] = {}
    for start in (name for one in transforms for name in (one.parent, one.child)):
        frame, way = start, {start: None}
        while frame in parents and frame not in found:
            frame = parents[frame]
            if frame in way:
                break
            way[frame] = None
        found |= dict.fromkeys(way, found.get(frame, frame))
    return list(dict.fromkeys(found.values()))
