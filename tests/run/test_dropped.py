"""An endpoint that ends with the constructor that made it, in real processes."""

from __future__ import annotations

import pytest

from grader.findings.finding import Finding, Status
from grader.recording.model import Recording
from tests.checks.builder import CHECKS
from tests.run.conftest import RunNode
from tests.run.nodes import HEADER

pytestmark = pytest.mark.ros

NODE = (
    HEADER
    + """
from rclpy.qos import DurabilityPolicy
from rclpy.wait_for_message import wait_for_message

rclpy.init()
node = rclpy.create_node("bot_publisher")
publisher = node.create_publisher(Twist, "/cmd_vel", 10)
publisher.publish(twist())
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
goal = node.create_publisher(Vector3, "/goal", latched)
goal.publish(Vector3())
{}
rclpy.spin(node)
"""
)
UNTIL = {"elapsed": "2 s"}


def judged(recording: Recording, check: str, topic: str) -> Finding:
    """The finding of a check of a topic."""
    found = CHECKS[check]
    return found.judge(recording, found.parameters.model_validate({"topic": topic}))


def test_a_publisher_that_ends_before_the_executor_spins_costs_its_own_check(
    run_node: RunNode,
) -> None:
    run = run_node(NODE.format("node.destroy_publisher(publisher)"), until=UNTIL)
    finding = judged(run, "topic.published", "/cmd_vel")
    assert finding.status is Status.FAILED and finding.stands_alone, finding
    assert "was destroyed" in finding.observed and "while the process still ran" in finding.observed


@pytest.mark.parametrize(
    "ends",
    [
        "node.create_timer(0.2, lambda: node.destroy_publisher(publisher))",
        "node.destroy_node(), rclpy.shutdown(), sys.exit()",
        "again = node.create_publisher(Twist, '/cmd_vel', 10), node.destroy_publisher(publisher)",
    ],
)
def test_a_publisher_that_ends_on_purpose_was_there(run_node: RunNode, ends: str) -> None:
    run = run_node(NODE.format(ends), until=UNTIL)
    finding = judged(run, "topic.published", "/cmd_vel")
    assert finding.status is Status.PASSED, finding


def test_wait_for_message_subscribes(run_node: RunNode) -> None:
    waits = "assert wait_for_message(Vector3, node, '/goal', qos_profile=latched)[0]"
    run = run_node(NODE.format(waits), until=UNTIL)
    assert run.declared("destroyed")
    finding = judged(run, "topic.subscribed", "/goal")
    assert finding.status is Status.PASSED, finding
