"""The probe takes messages now and then, and records them as if it had taken each at once."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from geometry_msgs.msg import Twist
from rclpy.context import Context

from grader.run.cell.domain import lock_domain
from grader.run.cell.probe import Probe
from grader.run.order import RunLimits, Topic

pytestmark = [
    pytest.mark.ros,
    # lark, which rclpy's interfaces import, still uses it.
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),
]

TOPIC = Topic("/cmd_vel", "geometry_msgs/msg/Twist", "reliable", "volatile", 100)


@pytest.fixture
def probe_and_publisher() -> Iterator[tuple[Probe, Any]]:
    with lock_domain() as lock:
        probe = Probe(lock.domain_id)
        probe.listen((TOPIC,), RunLimits(5, 5, 1))
        outside = Context()
        rclpy.init(context=outside, domain_id=lock.domain_id)
        student = rclpy.create_node("student", context=outside)
        publisher = student.create_publisher(Twist, TOPIC.name, 10)
        while not publisher.get_subscription_count() or not probe.has_met():
            probe.spin_once(0.05)
        yield probe, publisher
        outside.try_shutdown()
        probe.close()


def test_messages_that_waited_keep_their_own_times(
    probe_and_publisher: tuple[Probe, Any],
) -> None:
    probe, publisher = probe_and_publisher
    sent = []
    for _ in range(50):
        publisher.publish(Twist())
        sent.append(time.time_ns())
    while probe.counts[TOPIC.name] < 50:
        probe.spin_once(0.01)
    stamps = [message.stamp_ns for message in probe.messages]
    assert all(earlier < later for earlier, later in pairwise(stamps))
    assert all(stamp <= limit for stamp, limit in zip(stamps, sent, strict=True))
    assert [message.sequence for message in probe.messages] == list(range(1, 51))
