"""What the probe asks of real nodes: services, parameters, states, and what they log."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.errors import GraderFault
from grader.findings.finding import Status
from grader.machine import ros
from grader.machine.ros import RosInstallation
from grader.recording.model import Ending
from grader.run.programs import launch_file_program, with_shares
from grader.run.stimuli.parameters import next_call_s
from tests.checks.builder import judge
from tests.run.conftest import RunNode

SET_BOOL = "std_srvs/srv/SetBool"

SERVER = """\
import time, rclpy
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.node import Node
from std_srvs.srv import SetBool

class Bot(Node):
    def __init__(self):
        super().__init__("bot")
        limits = FloatingPointRange(from_value=0.0, to_value=1.0, step=0.0)
        self.declare_parameter("speed", 0.5, ParameterDescriptor(floating_point_range=[limits]))
        self.declare_parameter("names", ["a", "b"])
        self.create_service(SetBool, "enable", self.enable)

    def enable(self, request, response):
        self.get_logger().info(f"enable {request.data}")
        time.sleep(0.2)
        response.success = request.data
        response.message = "\\u00e9"
        return response

rclpy.init()
rclpy.spin(Bot())
"""

LIFECYCLE = """\
import rclpy
from rclpy.lifecycle import LifecycleNode

rclpy.init()
rclpy.spin(LifecycleNode("bot"))
"""


@pytest.mark.ros
def test_calls_parameters_and_logs_of_one_node(run_node: RunNode) -> None:
    recording = run_node(
        SERVER,
        record=[],
        stimuli=[
            {"call": "/enable", "type": SET_BOOL, "request": {"data": True}, "at_once": 2},
            {"call": "/enable", "type": SET_BOOL, "requests": [{}], "after": "1 s"},
            {"set_parameters": {"speed": 0.75, "names": ["c"]}, "node": "bot", "after": "1 s"},
            {"set_parameters": {"speed": 7.0}, "node": "bot", "after": "1500 ms"},
        ],
        until={"stimuli": "done"},
        timeout="20 s",
    )
    assert recording.ending is Ending.UNTIL
    first, second, third = (call for call in recording.calls if call.service == "/enable")
    assert (first.request, first.response) == (
        {"data": True},
        {"success": True, "message": "\u00e9"},
    )
    assert second.requested_ns < (first.answered_ns or 0) < (second.answered_ns or 0)
    assert (third.request, (third.response or {})["success"]) == ({"data": False}, False)
    (service,) = (item for item in recording.services if item.name == "/enable")
    assert (service.type, service.node) == (SET_BOOL, "/bot")
    waits = {"service": "/enable", "takes": "200 ms", "calls": "one_after_another"}
    speed = {"node": "bot", "name": "speed"}
    for name, parameters in [
        ("service.concurrent", waits),
        ("parameter.declared", {**speed, "type": "double", "default": 0.5, "range": [0, 1]}),
        ("parameter.declared", {"node": "bot", "name": "names", "default": ["a", "b"]}),
        ("parameter.set", {**speed, "value": 0.75}),
        ("parameter.set", {"node": "bot", "name": "names", "value": ["c"]}),
        ("parameter.set", {**speed, "value": 7.0, "accepted": False, "reason": "range"}),
        ("log.contains", {"text": "enable", "level": "INFO", "at_least": 3, "at_most": 3}),
    ]:
        finding = judge(name, recording, **parameters)
        # A busy machine may have disturbed it, which is reported and costs no point.
        assert finding.status is Status.PASSED or finding.disturbed, finding
    records = [line for line in recording.log if line.stream == "rosout"]
    assert {(line.process, line.level) for line in records} == {("bot", "INFO")}


@pytest.mark.ros
def test_a_service_that_is_not_there_does_not_hold_the_run_up(run_node: RunNode) -> None:
    recording = run_node(
        SERVER,
        record=[],
        stimuli=[{"call": "/enabel", "type": SET_BOOL, "request": {"data": True}}],
        until={"stimuli": "done"},
        timeout="30 s",
    )
    assert recording.ending is Ending.UNTIL
    (call,) = (call for call in recording.calls if call.service == "/enabel")
    assert (call.answered_ns, call.error) == (None, "no server")
    finding = judge("service.responds", recording, service="/enabel")
    assert "the service `/enable` instead of `/enabel`" in finding.observed


@pytest.mark.ros
@pytest.mark.skipif("lifecycle_msgs" not in ros.find().packages, reason="no lifecycle_msgs here")
def test_a_lifecycle_node_goes_through_its_states(run_node: RunNode) -> None:
    recording = run_node(
        LIFECYCLE,
        record=[],
        stimuli=[
            {"lifecycle": "bot", "do": ["configure", "activate"], "every": "300 ms"},
            {"lifecycle": "bot", "do": ["activate", "shutdown"], "after": "1 s"},
        ],
        until={"stimuli": "done"},
        timeout="20 s",
    )
    asked_ns = [call.requested_ns for call in recording.calls if call.service == "/bot/get_state"]
    first_ns, second_ns, third_ns = asked_ns[:3]
    assert min(second_ns - first_ns, third_ns - second_ns) >= 300 * 10**6
    # It cannot be activated twice.
    states = ["unconfigured", "inactive", "active", "active", "active", "finalized"]
    wanted = {"node": "bot", "states": states}
    finding = judge("lifecycle.state", recording, **wanted)
    assert finding.status is Status.PASSED, finding


PATIENT = SERVER.replace(
    'self.create_service(SetBool, "enable", self.enable)',
    """self.create_service(SetBool, "enable", self.enable)
        self.create_client(SetBool, "nowhere").wait_for_service(3.0)""",
)
NEVER_SPINS = SERVER.replace("rclpy.spin(Bot())", "bot = Bot()\ntime.sleep(60)")

ASKED = [
    {"call": "/enable", "type": SET_BOOL, "request": {"data": True}},
    {"set_parameters": {"speed": 0.75}, "node": "bot"},
    {"call": "list_parameters", "every": "500 ms"},
]
ASKING_CHECKS = [
    ("service.responds", {"service": "/enable", "response": {"success": True}}),
    ("parameter.declared", {"node": "bot", "name": "speed", "default": 0.5}),
    ("parameter.set", {"node": "bot", "name": "speed", "value": 0.75}),
    ("executor.responsive", {}),
]


@pytest.mark.ros
def test_a_node_whose_constructor_waits_is_asked_when_it_spins(run_node: RunNode) -> None:
    recording = run_node(
        PATIENT, record=[], stimuli=ASKED, until={"stimuli": "done"}, timeout="20 s"
    )
    assert recording.ending is Ending.UNTIL
    for name, parameters in ASKING_CHECKS:
        finding = judge(name, recording, **parameters)
        assert finding.status is Status.PASSED or finding.disturbed, finding


@pytest.mark.ros
def test_a_node_that_never_spins_is_found_out(run_node: RunNode) -> None:
    recording = run_node(
        NEVER_SPINS, record=[], stimuli=ASKED, until={"stimuli": "done"}, timeout="6 s"
    )
    for name, parameters in ASKING_CHECKS:
        finding = judge(name, recording, **parameters)
        assert finding.status is Status.FAILED, finding
        assert "rclpy.spin() was never called" in finding.observed


@pytest.mark.ros
def test_what_is_due_at_once_is_asked_in_the_order_of_the_list(run_node: RunNode) -> None:
    """One callback takes 200 ms; the values of the calls tell their order."""
    values = [True, False, True, True, False]
    recording = run_node(
        SERVER.replace("rclpy.spin(Bot())", "rclpy.spin(Bot(), MultiThreadedExecutor(4))").replace(
            "import time, rclpy", "import time, rclpy\nfrom rclpy.executors import *"
        ),
        record=[],
        stimuli=[
            *(
                {"call": "/enable", "type": SET_BOOL, "request": {"data": value}}
                for value in values[:3]
            ),
            {"set_parameters": {"speed": 0.75}, "node": "bot"},
            *(
                {"call": "/enable", "type": SET_BOOL, "request": {"data": value}}
                for value in values[3:]
            ),
        ],
        until={"stimuli": "done"},
        timeout="20 s",
    )
    calls = [call for call in recording.calls if call.request is not None]
    assert [call.request["data"] for call in calls if call.service == "/enable"] == values
    ends = [call.answered_ns or 0 for call in calls]
    assert all(call.requested_ns >= end for call, end in zip(calls[1:], ends, strict=False))
    services = [call.service.rpartition("/")[2] for call in calls]
    assert services[:4] == ["enable"] * 3 + ["list_parameters"]
    assert services[-2:] == ["enable"] * 2


DESTROYER = """\
import rclpy
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import SetBool

class Bot(Node):
    def __init__(self):
        super().__init__("bot")
        self.heard = 0
        self.answer = self.create_publisher(String, "/echo", 10)
        self.subscription = self.create_subscription(String, "/chatter", self.take, 10)
        self.service = self.create_service(SetBool, "enable", lambda request, response: response)

    def take(self, message):
        self.answer.publish(message)
        self.heard += 1
        if self.heard == 10:
            self.destroy_subscription(self.subscription)
            self.destroy_service(self.service)

rclpy.init()
rclpy.spin(Bot())
"""


@pytest.mark.ros
def test_what_a_node_destroys_in_the_middle_is_seen_and_named(run_node: RunNode) -> None:
    text = "std_msgs/msg/String"
    chatter = {"publish": "/chatter", "type": text, "message": {"data": "hello"}}
    recording = run_node(
        DESTROYER,
        record=[{"topic": "/echo", "type": text}],
        stimuli=[
            {**chatter, "every": "50 ms", "count": 20},
            {"call": "/enable", "type": SET_BOOL, "after": "1500 ms"},
        ],
        until={"stimuli": "done"},
        timeout="20 s",
    )
    latency = {"stimulus": "/chatter", "topic": "/echo", "most": "1 s"}
    for check, parameters, destroyed in [
        ("timing.latency", latency, "the subscription to `/chatter` was destroyed"),
        ("service.responds", {"service": "/enable"}, "`/enable` could not be asked: it was there,"),
    ]:
        finding = judge(check, recording, **parameters)
        assert finding.status is Status.FAILED, finding
        assert destroyed in finding.observed


def ros_with(*packages: str, folder: Path) -> RosInstallation:
    index = folder / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    for package in packages:
        (index / package).touch()
    (folder / "bin").mkdir()
    (folder / "bin" / "ros2").touch()
    return RosInstallation("sourced", Path(sys.executable), (folder,))


def test_a_launch_file_is_started_as_ros2_launch_does(tmp_path: Path) -> None:
    program = launch_file_program(ros_with("ros2launch", folder=tmp_path), "bot", "demo.launch.py")
    ros2 = str(tmp_path / "bin" / "ros2")
    assert program == (sys.executable, ros2, "launch", "bot", "demo.launch.py")


def test_without_ros2_launch_a_launch_file_is_our_fault(tmp_path: Path) -> None:
    with pytest.raises(GraderFault, match=r"bot/demo.launch.py is a launch file, and this ROS"):
        launch_file_program(ros_with("rclpy", folder=tmp_path), "bot", "demo.launch.py")


def test_the_folder_of_a_package_stands_in_an_argument(tmp_path: Path) -> None:
    (tmp_path / "b/share/course_files").mkdir(parents=True)
    given = ("params:=$(find-pkg-share course_files)/config/slow.yaml", "plain")
    folders = (tmp_path / "a", tmp_path / "b")
    share = tmp_path / "b/share/course_files"
    assert with_shares(given, folders) == (f"params:={share}/config/slow.yaml", "plain")
    with pytest.raises(GraderFault, match="there is no package 'course_files'"):
        with_shares(given, folders[:1])


@given(late_s=st.lists(st.floats(0, 0.5), min_size=1, max_size=20))
def test_a_late_call_to_an_executor_does_not_move_the_calls_after_it(late_s: list[float]) -> None:
    every_s = 0.23
    due_s = 100.0
    for late in late_s:
        now_s = due_s + late
        due_s = next_call_s(due_s, every_s, now_s)
        assert now_s < due_s + 1e-9 <= now_s + every_s + 2e-9
        assert (due_s - 100.0) / every_s == pytest.approx(round((due_s - 100.0) / every_s))
