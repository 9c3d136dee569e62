"""Turtles in a cell: driven by a real node over DDS, their truth recorded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from grader.assignment.model import Assignment
from grader.assignment.simulation import with_turtles
from grader.machine import ros
from grader.machine.resources import cache_folder
from grader.measure.turtle.drawing import drawn
from grader.recording.mcap_reader import read_recording
from grader.recording.model import Ending, Owner, Recording
from grader.run.request import RunRequest
from grader.run.runner import Runner
from grader.submission.underlay.store import UnderlayStore
from tests.run.conftest import SUBMISSION, assignment, install

pytestmark = [pytest.mark.ros, pytest.mark.compiles]

HEADER = """
import rclpy
from geometry_msgs.msg import Twist
from rclpy.action import ActionClient
from rclpy.node import Node
from turtlesim.action import RotateAbsolute
from turtlesim.msg import Pose
from turtlesim.srv import Kill, SetPen, Spawn, TeleportAbsolute

rclpy.init()
node = Node("driver")

def call(kind, service, **fields):
    client = node.create_client(kind, service)
    client.wait_for_service()
    future = client.call_async(kind.Request(**fields))
    rclpy.spin_until_future_complete(node, future)
    return future.result()
"""


@pytest.fixture
def run(runner: Runner, tmp_path: Path) -> Callable[..., Recording]:
    here = ros.find()
    turtlesim = UnderlayStore(cache_folder(), here).completed(here, ["turtlesim"]).underlays
    (tmp_path / "pond.yaml").write_text("turtles: [{name: turtle1}]\n", encoding="utf-8")

    def run(source: str, **scenario: object) -> Recording:
        changes = {"record": [], "world": "pond.yaml", "timeout": "15 s", **scenario}
        course: Assignment = with_turtles(assignment(**changes), tmp_path)
        request = RunRequest(
            *(course, course.scenarios[0], SUBMISSION, install(tmp_path, HEADER + source), 1),
            worlds=tmp_path,
            underlays=turtlesim,
            type_support=turtlesim,
        )
        runner.run(request, tmp_path / "run.mcap")
        return read_recording(tmp_path / "run.mcap")

    return run


def test_what_a_node_does_to_turtles_is_recorded(run: Callable[..., Recording]) -> None:
    recording = run(
        """
call(SetPen, "/turtle1/set_pen", r=255, width=5)
assert call(Spawn, "/spawn", x=2.0, y=3.0, name="bob").name == "bob"
publisher = node.create_publisher(Twist, "/turtle1/cmd_vel", 10)
speeds = []
take = lambda pose: speeds.append(pose.linear_velocity)
node.create_subscription(Pose, "/turtle1/pose", take, 10)
while not (publisher.get_subscription_count() and speeds):
    rclpy.spin_once(node)
message = Twist()
message.linear.x = 1.0
publisher.publish(message)
while not any(speeds) or speeds[-1]:
    rclpy.spin_once(node)
call(Kill, "/kill", name="bob")
rotate = ActionClient(node, RotateAbsolute, "/turtle1/rotate_absolute")
rotate.wait_for_server()
sent = rotate.send_goal_async(RotateAbsolute.Goal(theta=0.5))
rclpy.spin_until_future_complete(node, sent)
rclpy.spin_until_future_complete(node, sent.result().get_result_async())
rclpy.spin(node)
""",
        until={"at_rest": "2 s"},
    )
    assert recording.ending is Ending.UNTIL
    last = next(one for one in reversed(recording.truth) if one.robot == "turtle1")
    # The command acts for a second, and rounded up to steps.
    assert last.x_m == pytest.approx(499 / 90 + 63 * 0.016)
    assert last.yaw_rad == pytest.approx(0.5, abs=0.02)
    kinds = [(one.kind, one.turtle) for one in recording.turtles]
    expected = ["background", "killed", "pen", "placed", "spawned"]
    assert sorted(kind for kind, _ in kinds) == expected
    assert [kind for kind, turtle in kinds if turtle == "bob"] == ["spawned", "killed"]
    (line,) = drawn(recording)
    assert (line.colour, line.width, len(line.points)) == ((255, 0, 0), 5, 2)
    assert [one.robot for one in recording.incidents if one.kind == "command_timeout"] == [
        "turtle1"
    ]
    asked = {one.server: one for one in recording.asked}
    assert asked["/spawn"].answer == {"name": "bob"}
    assert asked["/turtle1/rotate_absolute"].status == "succeeded"
    owners = {one.name: one.owner for one in recording.nodes}
    assert owners["/turtlesim"] is Owner.PROBE
    assert recording.on("/turtle1/cmd_vel")


def test_no_topic_of_a_student_changes_the_truth(run: Callable[..., Recording]) -> None:
    recording = run(
        """
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
pose = node.create_publisher(Pose, "/turtle1/pose", 10)
value = ParameterValue(type=1, bool_value=True)
asked = [Parameter(name="use_sim_time", value=value)]
call(SetParameters, "/turtlesim/set_parameters", parameters=asked)
call(TeleportAbsolute, "/turtle1/teleport_absolute", x=float("nan"))
node.create_timer(0.02, lambda: pose.publish(Pose(x=1.0, y=1.0)))
rclpy.spin(node)
""",
        until={"elapsed": "2 s"},
    )
    assert {(one.x_m, one.y_m) for one in recording.truth} == {(499 / 90, 499 / 90)}
    times = [one.time_ns for one in recording.truth]
    assert recording.launched_ns < times[0] < times[-1] < recording.end_ns
