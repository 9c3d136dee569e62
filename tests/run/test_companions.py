"""Programs of the author's run beside the student's, and nothing of theirs is the student's."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.findings.finding import Status
from grader.recording.model import Ending, Owner
from tests.checks.builder import judge
from tests.run.conftest import RunNode, install

pytestmark = pytest.mark.ros

LIGHT = """
import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node

class Light(Node):
    def __init__(self):
        super().__init__("light")
        self.publisher = self.create_publisher(Twist, "light", 10)
        self.create_timer(0.1, lambda: self.publisher.publish(Twist()))

rclpy.init()
rclpy.spin(Light())
"""
REPEATER = """
import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node

class Repeater(Node):
    def __init__(self):
        super().__init__("repeater")
        self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Twist, "light", self.publisher.publish, 10)

rclpy.init()
rclpy.spin(Repeater())
"""
BROKEN = "raise ValueError('no lamp')"
COMPANIONS = [{"package": "course_nodes", "executable": "light"}]


def test_what_a_companion_does_is_heard_and_is_not_the_student_s(
    run_node: RunNode, tmp_path: Path
) -> None:
    course = install(tmp_path / "course", LIGHT, "course_nodes/light")
    run = run_node(REPEATER, underlays=(course,), companions=COMPANIONS)
    assert run.ending is Ending.UNTIL and not run.faults
    assert len(run.on("/cmd_vel")) >= 3
    owners = {node.name: node.owner for node in run.nodes}
    assert (owners["/light"], owners["/repeater"]) == (Owner.COMPANION, Owner.STUDENT)
    assert [process.name for process in run.processes] == ["bot_publisher/bot_pub"]
    assert run.processes[0].survivors == ()
    assert judge("node.ends", run, within="2 s").status is Status.PASSED


def test_a_companion_that_fails_is_no_fault_of_the_student_s(
    run_node: RunNode, tmp_path: Path
) -> None:
    course = install(tmp_path / "course", BROKEN, "course_nodes/light")
    run = run_node(REPEATER, underlays=(course,), companions=COMPANIONS)
    assert run.ending is Ending.FAULT
    (fault,) = run.faults
    assert fault.startswith("the companion course_nodes/light of the assignment ended with exit")
    assert fault.endswith("ValueError: no lamp")
