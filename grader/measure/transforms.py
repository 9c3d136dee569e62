"""Transforms between frames, as messages have them (REP-103, REP-105)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grader.recording.model import NS, Message, Recording

TRANSFORMS = "tf2_msgs/msg/TFMessage"
# What tf2 takes for a quaternion of length 1 (tf2/src/buffer_core.cpp).
_UNIT = 1e-2
_LONGEST_NAME = 100


@dataclass(frozen=True)
class Sent:
    """A transform as it was published.

    Attributes:
        value: A geometry_msgs/msg/Transform.
        stamp_ns: Of its header.
    """

    parent: str
    child: str
    value: Mapping[str, Any]
    stamp_ns: int
    message: Message

    @property
    def is_valid(self) -> bool:
        """Whether tf2 takes it: finite, and its quaternion has the length 1."""
        length = math.hypot(*self.value["rotation"].values())
        finite = all(map(math.isfinite, self.value["translation"].values()))
        return finite and abs(length * length - 1.0) <= _UNIT


def is_static(topic: str) -> bool:
    """Whether it is a topic of static transforms, by its name."""
    return topic.endswith("tf_static")


def sent(recording: Recording, topics: Iterable[str]) -> Iterator[Sent]:
    """The transforms on some topics, in the order of their publishing on each."""
    for topic in topics:
        for message in recording.on(topic):
            if message.type == TRANSFORMS:
                yield from _transforms_in(message)


def _transforms_in(message: Message) -> Iterator[Sent]:
    for item in message.value["transforms"]:
        parent, child = item["header"]["frame_id"], item["child_frame_id"]
        stamp_ns = stamp_of(item) or 0
        yield Sent(
            parent[:_LONGEST_NAME], child[:_LONGEST_NAME], item["transform"], stamp_ns, message
        )


def stamp_of(message: Mapping[str, Any]) -> int | None:
    """The stamp in a message's header in nanoseconds, or None where it has none."""
    header = message.get("header")
    stamp = header.get("stamp") if isinstance(header, Mapping) else None
    return stamp["sec"] * NS + stamp["nanosec"] if isinstance(stamp, Mapping) else None


def quaternion(roll: float, pitch: float, yaw: float) -> dict[str, float]:
    """Of a rotation about the parent's x, then y, then z axis."""
    a, b, c = (math.sin(angle / 2.0) for angle in (roll, pitch, yaw))
    i, j, k = (math.cos(angle / 2.0) for angle in (roll, pitch, yaw))
    x, y = a * j * k - i * b * c, i * b * k + a * j * c
    return {"x": x, "y": y, "z": i * j * c - a * b * k, "w": i * j * k + a * b * c}


def roots(transforms: Sequence[Sent]) -> list[str]:
    """Where the ways from all frames to their parents end; of a circle, one of its frames."""
    parents = {one.child: one.parent for one in reversed(transforms)}
    root_of: dict[str, str] = {}
    for start in (name for one in transforms for name in (one.parent, one.child)):
        # A dict, for a program may send any number of frames.
        frame, way = start, {start: None}
        while frame in parents and frame not in root_of:
            frame = parents[frame]
            if frame in way:
                break
            way[frame] = None
        root_of |= dict.fromkeys(way, root_of.get(frame, frame))
    return list(dict.fromkeys(root_of.values()))
