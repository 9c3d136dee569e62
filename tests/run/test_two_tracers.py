"""The tracer in Python and the compiled one report the same events of the same node."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from grader.machine import ros
from grader.recording.model import Recording
from grader.run.compiled_tracer import compiled_tracer
from grader.run.environment import TRACER
from tests.run.conftest import RunNode
from tests.run.nodes import HEADER

pytestmark = [pytest.mark.compiles, pytest.mark.ros]

# It has what rcl can see, and ends in its own time.
NODE = (
    HEADER
    + """
from rclpy.qos import DurabilityPolicy

class BotPublisher(Node):
    def __init__(self):
        super().__init__("bot_publisher", namespace="robot")
        late = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        sensor = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.publisher = self.create_publisher(Twist, "/cmd_vel", 7)
        self.other = self.create_publisher(Vector3, "latched", late)
        self.heard = self.create_subscription(Vector3, "goal", print, sensor)
        self.publisher.publish(twist())
        self.timer = self.create_timer(0.05, self.publish)
        self.count = 0

    def publish(self):
        self.publisher.publish(twist())
        self.count += 1
        if self.count == 8:
            self.destroy_subscription(self.heard)
            self.destroy_publisher(self.other)
            raise KeyboardInterrupt

rclpy.init()
node = BotPublisher()
try:
    rclpy.spin(node)
except KeyboardInterrupt:
    node.destroy_node()
    rclpy.shutdown()
"""
)
# Begins anew with the other tracer.
OTHER_TRACER = """\
import os, sys
if "ROSGRADE_TRACER_PYTHON" not in os.environ:
    paths = os.environ["PYTHONPATH"].split(os.pathsep)
    os.environ["PYTHONPATH"] = os.pathsep.join(path for path in paths if path != {tracer!r})
    os.environ.update(ROSGRADE_TRACER_PYTHON="1", LD_PRELOAD={library!r})
    os.execv(sys.executable, [sys.executable, *sys.argv])
"""
_QOS = ("reliability", "durability", "history", "depth")
SEEN_BY_RCL = {
    "init": ("changed",),
    "node": ("node",),
    "publisher": ("node", "topic", "type", *_QOS),
    "subscription": ("node", "topic", "type", *_QOS),
    "timer": ("period_s",),
    "held": ("topic", "matched"),
    "spin": (),
    "destroyed": (),
    "leaving": (),
    "exiting": (),
}


def seen(recording: Recording) -> Iterator[str]:
    """What was declared, without ids and times."""
    topics: dict[Any, str] = {}
    for item in recording.declarations:
        data = item.data
        if item.kind in ("publisher", "subscription"):
            topics[data["number"]] = f"{item.kind} on {data['topic']}"
        # A timer of rclpy lasts as long as its node: only the compiled tracer tells of its end.
        is_timer = item.kind == "destroyed" and data.get("number") not in topics
        if item.kind in SEEN_BY_RCL and not is_timer:
            what = {key: data.get(key) for key in SEEN_BY_RCL[item.kind]}
            yield f"{item.kind}: {what or topics.get(data.get('number'), '')}"


def test_both_tracers_report_the_same_of_the_same_node(run_node: RunNode, tmp_path: Path) -> None:
    library = compiled_tracer(ros.find(), tmp_path)
    other = OTHER_TRACER.format(tracer=str(TRACER), library=str(library))
    python = sorted(seen(run_node(NODE, until={"messages": 50})))
    compiled = sorted(seen(run_node(other + NODE, until={"messages": 50})))
    assert {line.partition(":")[0] for line in python} == SEEN_BY_RCL.keys()
    assert compiled == python
