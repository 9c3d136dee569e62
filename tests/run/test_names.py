"""A run puts wrong names right: of a node, of its topics, services and actions."""

from __future__ import annotations

import pytest

from grader.recording.model import Kind
from grader.spec.names import Names, Thing, WrongName
from tests.checks.builder import judge
from tests.run.conftest import RunNode

MISNAMED = """
import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node
from std_srvs.srv import SetBool

rclpy.init()
node = Node("pub", namespace="/lab")
publisher = node.create_publisher(Twist, "cmdvel", 10)
node.create_timer(0.1, lambda: publisher.publish(Twist()))
for name in ("/ligth", "/fibb/_action/send_goal", "~/reset"):
    node.create_service(SetBool, name, lambda request, response: response)
other = Node("helper", namespace="/lab")
executor = rclpy.executors.SingleThreadedExecutor()
executor.add_node(node)
executor.add_node(other)
executor.spin()
"""
NODE = WrongName(Thing.NODE, "/lab/pub", "/bot_publisher")


@pytest.mark.ros
def test_a_run_puts_right_the_names_of_a_node_of_topics_services_and_actions(
    run_node: RunNode,
) -> None:
    names = Names.of(
        [
            NODE,
            WrongName(Thing.TOPIC, "/cmdvel", "/cmd_vel"),
            WrongName(Thing.SERVICE, "/ligth", "/light"),
            WrongName(Thing.ACTION, "/fibb", "/fib"),
        ]
    )
    recording = run_node(MISNAMED, names=names)
    assert recording.names == names
    assert {node.name for node in recording.student_nodes} == {"/bot_publisher", "/lab/helper"}
    assert len(recording.on("/cmd_vel")) >= 3
    services = {service.name for service in recording.services}
    assert {"/light", "/fib/_action/send_goal", "/bot_publisher/reset"} <= services
    finding = judge("node.exists", recording, name="bot_publisher", remap=True)
    assert finding.names == Names.of([NODE])


@pytest.mark.ros
def test_without_wrong_names_a_node_keeps_its_own(run_node: RunNode) -> None:
    recording = run_node(MISNAMED, until={"elapsed": "1 s"})
    assert {item.topic for item in recording.student_endpoints(Kind.PUBLISHER)} >= {"/lab/cmdvel"}
    finding = judge("node.exists", recording, name="pubs", remap=True)
    assert finding.names == Names.of([WrongName(Thing.NODE, "/lab/pub", "/pubs")])
