"""The simulated robot in a cell: driven by a real node over DDS, its truth recorded."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest

from grader.recording.model import NS, Ending, Kind
from grader.recording.one_robot import of_robot
from sim.motion import Pose
from tests.run import nodes
from tests.run.conftest import RunNode

pytestmark = pytest.mark.ros

WORLD = "boxes:\n  - {centre: [1.0, 0], size: [0.2, 2]}\n"
DRIVER = (
    nodes.HEADER
    + """
from sensor_msgs.msg import LaserScan

class Driver(Node):
    def __init__(self):
        super().__init__("driver")
        self.publisher = self.create_publisher(Twist, "/cmd_vel", 10)
        self.create_subscription(LaserScan, "/scan", self.scanned, 10)

    def scanned(self, scan):
        message = Twist()
        message.linear.x = {speed} if scan.ranges[0] > {stop} else 0.0
        self.publisher.publish(message)

rclpy.init()
rclpy.spin(Driver())
"""
)


def driver(speed: str = "0.2", stop: str = "0.4") -> str:
    return DRIVER.replace("{speed}", speed).replace("{stop}", stop)


@pytest.fixture
def world(tmp_path: Path) -> str:
    file = tmp_path / "world.yaml"
    file.write_text(WORLD, encoding="utf-8")
    return str(file)


def test_the_robot_stops_where_the_node_stops_it(run_node: RunNode, world: str) -> None:
    recording = run_node(
        driver(),
        record=[],
        world=world,
        lidar={"pose": [-0.03, 0, "0 deg"]},
        until={"at_rest": "500 ms"},
        timeout="15 s",
    )
    assert recording.ending is Ending.UNTIL
    last = recording.truth[-1]
    # The wall begins at x = 0.9, the LiDAR sits 3 cm behind the middle of the robot, and a scan
    # comes every 0.2 s, in which it goes 4 cm.
    assert 0.93 - 0.4 < last.x_m < 0.93 - 0.4 + 0.1
    assert (last.y_m, last.linear_m_s, last.contact) == (0.0, 0.0, None)
    steps = [b.time_ns - a.time_ns for a, b in itertools.pairwise(recording.truth)]
    assert set(steps) == {10_000_000}
    assert recording.scene is not None
    assert recording.scene.began_ns == recording.truth[0].time_ns - 10_000_000
    assert recording.scene.outlines.keys() == {"boxes[0]"}
    assert recording.scene.lidar == Pose(-0.03, 0.0, 0.0)
    assert recording.scene.command_topic == "/cmd_vel"


def test_the_messages_of_the_sensors_are_recorded(run_node: RunNode, world: str) -> None:
    recording = run_node(driver(), record=[], world=world, until={"elapsed": "2 s"}, timeout="15 s")
    scans = recording.on("/scan")
    assert len(scans) == pytest.approx(10, abs=2)
    assert scans[0].value["ranges"][0] == pytest.approx(0.9)
    assert math.isinf(scans[0].value["ranges"][180])
    assert len(recording.on("/odom")) == pytest.approx(60, abs=8)
    assert recording.on("/cmd_vel")
    assert [e.node for e in recording.student_endpoints(Kind.SUBSCRIPTION, "/scan")] == ["/driver"]


def test_a_contact_is_recorded_and_ends_the_run(run_node: RunNode, world: str) -> None:
    recording = run_node(
        driver(stop="0.0"), record=[], world=world, until={"at_rest": "5 s"}, timeout="30 s"
    )
    first = next(truth for truth in recording.truth if truth.contact)
    assert first.contact == "boxes[0]"
    assert first.x_m == pytest.approx(0.9 - 0.1, abs=1e-3)
    kinds = [incident.kind for incident in recording.incidents]
    assert next(kind for kind in kinds if kind != "late") == "contact_began"
    assert recording.ending is Ending.UNTIL
    assert (recording.truth[-1].time_ns - first.time_ns) / NS == pytest.approx(1.0, abs=0.5)


def test_the_robot_stands_before_executors_pause(run_node: RunNode, world: str) -> None:
    run = run_node(driver(), pauses=True, world=world, until={"elapsed": "1 s"}, timeout="15 s")
    assert run.truth[-1].time_ns <= run.pauses[0].began_ns


def test_commands_that_are_no_numbers_are_refused_and_noted(run_node: RunNode, world: str) -> None:
    recording = run_node(
        driver(speed="float('nan')"),
        record=[],
        world=world,
        until={"elapsed": "1 s"},
        timeout="15 s",
    )
    assert {truth.x_m for truth in recording.truth} == {0.0}
    assert "command_rejected" in {incident.kind for incident in recording.incidents}


def test_random_values_reach_the_world_and_the_parameters(
    run_node: RunNode, tmp_path: Path
) -> None:
    file = tmp_path / "random.yaml"
    file.write_text("values: {x: 3}\nsegments:\n  - [$x, -1, $x, 1]\n", encoding="utf-8")
    source = driver().replace(
        "rclpy.spin(Driver())",
        "node = Driver()\nprint(node.declare_parameter('far', 0.0).value)\nrclpy.spin(node)",
    )
    recording = run_node(
        source,
        record=[],
        world=str(file),
        random={"x": ["1 m", "2 m"], "far": [5, 6]},
        launch=[{"executable": "bot_pub", "parameters": {"far": "$far"}}],
        until={"elapsed": "1 s"},
        timeout="15 s",
    )
    assert 1.0 <= recording.values["x"] <= 2.0
    assert recording.on("/scan")[0].value["ranges"][0] == pytest.approx(recording.values["x"])
    printed = [line.text for line in recording.log if line.stream == "stdout"]
    assert printed == [str(recording.values["far"])]


LEADER = (
    nodes.HEADER
    + """
from sensor_msgs.msg import LaserScan

class Leader(Node):
    def __init__(self):
        super().__init__("leader")
        self.drive = self.create_publisher(Twist, "/tb2/cmd_vel", 10)
        self.create_subscription(LaserScan, "/tb1/scan", self.scanned, 10)

    def scanned(self, scan):
        message = Twist()
        message.linear.x = 0.2 if scan.ranges[0] < 0.8 else 0.0
        self.drive.publish(message)

rclpy.init()
rclpy.spin(Leader())
"""
)


def test_one_node_drives_a_robot_by_what_another_sees_of_it(run_node: RunNode, world: str) -> None:
    """The second drives away from the first until the first sees it 0.8 m ahead."""
    recording = run_node(
        LEADER,
        record=[],
        world=world,
        robots={"tb1": {"pose": [-2, 0, "0 deg"]}, "tb2": {"pose": [-1.5, 0, "0 deg"]}},
        until={"any": [{"elapsed": "6 s"}]},
        timeout="15 s",
    )
    assert [*recording.scenes] == ["tb1", "tb2"]
    stood, drove = (of_robot(recording, name) for name in recording.scenes)
    assert {step.x_m for step in stood.truth} == {-2.0}
    # It sees the back of the other robot, whose radius is 0.1 m, 5 times a second.
    assert -1.1 <= drove.truth[-1].x_m < -1.0
    assert len(stood.truth) == len(drove.truth)
    assert stood.scene is not None
    assert stood.scene.command_topic == "/tb1/cmd_vel"
    assert stood.scene.moving[0].pose_at(10**12) == Pose(drove.truth[-1].x_m, 0.0, 0.0)
    assert len(recording.on("/tb1/scan")) == len(recording.on("/tb2/scan")) > 10
