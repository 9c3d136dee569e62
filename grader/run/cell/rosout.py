"""What the student's loggers publish on /rosout, within bounds."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import Log
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from grader.recording.model import NS, LogLine
from grader.run.process.output import KeptLines

_TOPIC = "/rosout"
_DEPTH = 1000
_LONGEST = 8192
_LONGEST_NAME = 256
_LEVELS = {10: "DEBUG", 20: "INFO", 30: "WARN", 40: "ERROR", 50: "FATAL"}


def told_of_matches(on_match: Callable[[Any], None]) -> SubscriptionEventCallbacks:
    """Events of a subscription without rclpy's own, which only warn and cost CPU time."""
    return SubscriptionEventCallbacks(matched=on_match, use_default_callbacks=False)


class RosoutLog:
    """Subscribes to /rosout; the probe itself publishes nothing there."""

    def __init__(self) -> None:
        self._kept = KeptLines(0)

    def listen(self, node: Node, limit_bytes: int, on_match: Callable[[Any], None]) -> None:
        """Keep what comes from now on, and what was published before a logger was matched."""
        self._kept = KeptLines(limit_bytes)
        profile = QoSProfile(
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
        events = told_of_matches(on_match)
        node.create_subscription(Log, _TOPIC, self._take, profile, event_callbacks=events)

    @property
    def lines(self) -> tuple[LogLine, ...]:
        """Everything kept so far, in the order of its arrival."""
        return tuple(self._kept.lines)

    def _take(self, record: Any) -> None:
        stamp_ns = record.stamp.sec * NS + record.stamp.nanosec
        if stamp_ns < 0:
            # What is recorded has a time after 1970.
            stamp_ns = time.time_ns()
        name, text = (
            str(value)[:longest].encode(errors="replace").decode()
            for value, longest in ((record.name, _LONGEST_NAME), (record.msg, _LONGEST))
        )
        level = _LEVELS.get(int(record.level), str(record.level))
        self._kept.add(LogLine(stamp_ns, name, "rosout", text, level))
