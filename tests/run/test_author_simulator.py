"""A simulator of the author's: it tells the truth, and costs no points if it fails.

It is an ordinary node of a package of its own, see small_simulator.py.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from nav_msgs.msg import Odometry
from std_msgs.msg import Header

from grader.assignment.true_motion import TruthTopic
from grader.errors import GraderFault
from grader.findings.finding import Status
from grader.machine import ros
from grader.machine.resources import cache_folder
from grader.recording.model import Ending, Owner, Recording
from grader.report.model.result import remarks
from grader.run.cell.author_simulator import sighting_of
from grader.run.cell.signed_messages import Signed
from grader.run.runner import Runner
from grader.sandbox.sandbox import Sandbox
from grader.sandbox.trial import try_sandbox
from grader.submission.underlay.definition import find_underlay
from grader.submission.underlay.store import UnderlayStore
from tests.checks.builder import judge
from tests.run.conftest import RunNode, install, runs_of

pytestmark = pytest.mark.ros

SIMULATOR = (Path(__file__).parent / "small_simulator.py").read_text(encoding="utf-8")
LAUNCH = """
from launch import LaunchDescription
from launch_ros.actions import Node

def generate_launch_description():
    return LaunchDescription([Node(package="course_sim", executable="small_simulator")])
"""
DRIVER = """
import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.node import Node

class Driver(Node):
    def __init__(self):
        super().__init__("driver")
        self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
        {more}
        self.create_timer(0.05, self.drive)
        self.start = None

    def drive(self):
        if not self.publisher.get_subscription_count():
            return
        now = self.get_clock().now().nanoseconds / 1e9
        self.start = self.start or now
        command = Twist()
        command.linear.x = 0.2 if now - self.start < {lasts} else 0.0
        self.publisher.publish(command)
        {also}

rclpy.init()
rclpy.spin(Driver())
"""
FORGER = {
    "more": 'self.liar = self.create_publisher(PoseStamped, "model/pose", 10)',
    "also": "lie = PoseStamped(); lie.pose.position.x = 7.0; self.liar.publish(lie)",
}
SPY = DRIVER.replace(
    "rclpy.init()",
    """
import os
from pathlib import Path
roots = os.environ["AMENT_PREFIX_PATH"].split(":")
found = [str(path) for root in roots for path in Path(root).glob("lib/course_sim/*")]
for file in Path("/proc").glob("[0-9]*/cmdline"):
    if b"small_simulator" in file.read_bytes():
        found.append(str(file))
print("found:", found)
rclpy.init()
""",
).format(lasts=2.0, more="pass", also="pass")
AT_REST = {"at_rest": "1 s"}
GIVEN: dict[str, Any] = {
    "package": "course_sim",
    "executable": "small_simulator",
    "truth": {"topic": "/model/pose", "type": "geometry_msgs/msg/PoseStamped"},
    "clock": "/clock",
    "contact": "/bumper",
    "within": "20 s",
    "radius": "10 cm",
    "max_speed": "0.3 m/s",
    "max_angular_speed": "2 rad/s",
}


def driver(lasts: float = 2.0, more: str = "pass", also: str = "pass") -> str:
    return DRIVER.format(lasts=lasts, more=more, also=also)


@pytest.fixture
def simulate(run_node: RunNode, tmp_path: Path) -> RunNode:
    """Run a student's node beside the small simulator."""
    return beside_simulator(run_node, tmp_path)


def beside_simulator(run_node: RunNode, tmp_path: Path) -> RunNode:
    course = install(tmp_path / "course", SIMULATOR, "course_sim/small_simulator")

    def run(
        source: str = driver(),
        program: str | None = None,
        more: Any = (),
        until: Any = AT_REST,
        **own: Any,
    ) -> Recording:
        if program is not None:
            file = course / "lib/course_sim/small_simulator"
            file.write_text(f"#!{sys.executable}\n{program}", encoding="utf-8")
        return run_node(
            source,
            underlays=(*more, course),
            simulator={**GIVEN, **own},
            launch=[{"executable": "bot_pub", "parameters": {"use_sim_time": True}}],
            until=until,
            timeout="15 s",
        )

    return run


def test_a_student_s_node_drives_the_robot_and_checks_of_motion_judge_it(
    simulate: RunNode,
) -> None:
    run = simulate()
    assert run.ending is Ending.UNTIL and not run.faults
    owners = {node.name: node.owner for node in run.nodes}
    assert (owners["/small_simulator"], owners["/driver"]) == (Owner.COMPANION, Owner.STUDENT)
    assert run.truth[-1].x_m == pytest.approx(0.4, abs=0.06)
    assert judge("motion.drives", run, speed="0.2 m/s").status is Status.PASSED
    assert judge("motion.drives", run, speed="0.3 m/s").status is Status.FAILED
    goal = [run.truth[-1].x_m, 0, 0]
    assert judge("motion.reaches", run, goal=goal, position="5 cm").status is Status.PASSED
    assert judge("motion.reaches", run, goal=[3, 0, 0], position="5 cm").status is Status.FAILED
    assert judge("motion.no_contact", run).status is Status.PASSED
    assert judge("node.ends", run, within="5 s").status is Status.PASSED
    assert [process.name for process in run.processes] == ["bot_publisher/bot_pub"]
    assert remarks(run) == ()


def test_a_run_ends_after_a_contact_that_its_topic_tells(simulate: RunNode) -> None:
    run = simulate(driver(lasts=60.0).replace("0.2 if", "0.9 if"))
    assert not run.faults
    assert judge("motion.no_contact", run).status is Status.FAILED


def test_a_forged_truth_does_not_count_and_is_said(simulate: RunNode) -> None:
    run = simulate(driver(**FORGER))
    assert not run.faults
    assert max(step.x_m for step in run.truth) < 1.0
    assert judge("motion.drives", run, speed="0.2 m/s").status is Status.PASSED
    (remark,) = remarks(run)
    assert remark.startswith("/driver publishes on /model/pose: only what the simulator")


@pytest.mark.parametrize(
    ("parameters", "fault"),
    [
        ({"fails_after": 2.0}, "the simulator course_sim/small_simulator of the assignment ended"),
        ({"silent_after": 2.0}, "has published nothing on /model/pose for 3 s"),
        ({"slow_after": 2.0}, "of real time, slower than 0.9"),
    ],
)
def test_a_simulator_that_fails_in_a_run_is_no_fault_of_the_student_s(
    simulate: RunNode, parameters: dict[str, float], fault: str
) -> None:
    run = simulate(driver(), parameters=parameters, until={"elapsed": "12 s"})
    assert run.ending is Ending.FAULT
    assert fault in run.faults[0]


@pytest.mark.parametrize(
    ("own", "lacks"),
    [
        (
            {"truth": {"topic": "/other", "type": "geometry_msgs/msg/Pose"}},
            "there is no message of its own on /other",
        ),
        ({"ready": {"node": "/gazebo"}}, "there is no node /gazebo of its own"),
        ({"ready": {"service": "/spawn"}}, "there is no service /spawn"),
        ({"ready": {"topic": "/scan"}}, "there is no message on /scan"),
    ],
)
def test_a_simulator_that_never_gets_ready_is_an_error(
    simulate: RunNode, own: dict[str, Any], lacks: str
) -> None:
    run = simulate(**own, within="4 s")
    assert run.ending is Ending.FAULT and not run.processes
    assert lacks in run.faults[0]


def test_a_simulator_that_is_silent_at_the_end_is_an_error_as_well(simulate: RunNode) -> None:
    run = simulate(driver(), parameters={"silent_after": 4.0}, until={"elapsed": "5 s"})
    assert "has published nothing on /model/pose for" in run.faults[0]


STAMP = Time(sec=3, nanosec=5)
TURN = Quaternion(z=math.sin(0.5), w=math.cos(0.5))
POSE = Pose(position=Point(x=1.0, y=2.0), orientation=TURN)
TRANSFORM = TransformStamped(
    header=Header(stamp=STAMP),
    child_frame_id="robot",
    transform=Transform(translation=Vector3(x=1.0, y=2.0), rotation=TURN),
)
STAMPED_NS = 3 * 10**9 + 5


@pytest.mark.parametrize(
    ("message", "type", "frame", "stamp_ns"),
    [
        (POSE, "geometry_msgs/msg/Pose", None, 77),
        (
            PoseStamped(header=Header(stamp=STAMP), pose=POSE),
            "geometry_msgs/msg/PoseStamped",
            None,
            STAMPED_NS,
        ),
        (
            Odometry(header=Header(stamp=STAMP), pose=PoseWithCovariance(pose=POSE)),
            "nav_msgs/msg/Odometry",
            None,
            STAMPED_NS,
        ),
        (
            SimpleNamespace(transforms=[TransformStamped(child_frame_id="box"), TRANSFORM]),
            "tf2_msgs/msg/TFMessage",
            "robot",
            STAMPED_NS,
        ),
    ],
)
def test_each_type_of_truth_says_where_the_robot_is(
    message: Any, type: Any, frame: str | None, stamp_ns: int
) -> None:
    found = sighting_of(Signed(77, b"", message), TruthTopic(topic="/t", type=type, frame=frame))
    assert found is not None
    assert (found.time_ns, found.stamp_ns) == (77, stamp_ns)
    pose = found.pose
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((1.0, 2.0, 1.0))


def test_in_a_sandbox_the_student_sees_nothing_of_the_simulator(tmp_path: Path) -> None:
    found = try_sandbox()
    if found.problem:
        pytest.skip(f"no sandbox on this machine: {found.problem}; {found.remedy}")
    with Runner(ros.find(), sandbox=Sandbox(tmp_path / "cache")) as runner:
        run = beside_simulator(runs_of(runner, tmp_path), tmp_path)(SPY)
    assert run.ending is Ending.UNTIL and not run.faults
    assert judge("motion.drives", run, speed="0.2 m/s").status is Status.PASSED
    (said,) = {line.text for line in run.log if line.text.startswith("found: ")}
    assert said == "found: []"


def test_a_simulator_that_dies_at_once_says_why(simulate: RunNode) -> None:
    run = simulate(program="raise ValueError('no gravity')")
    assert run.ending is Ending.FAULT
    assert run.faults[0].endswith("ValueError: no gravity")


def test_a_program_that_its_package_does_not_install_is_named(simulate: RunNode) -> None:
    with pytest.raises(GraderFault, match="course_sim/gazebo of the assignment is not there"):
        simulate(executable="gazebo")


def test_a_launch_file_starts_it_as_well(simulate: RunNode, tmp_path: Path) -> None:
    store = UnderlayStore(cache_folder(), ros.find())
    wanted = [find_underlay("launch", tmp_path)]
    if store.missing(wanted):
        pytest.skip("the underlay launch is not built: rosgrade underlay add launch")
    folder = tmp_path / "course" / "install" / "share" / "course_sim"
    folder.mkdir(parents=True)
    (folder / "world.launch.py").write_text(LAUNCH, encoding="utf-8")
    (folder / "package.xml").write_text("<package format='3'><name>course_sim</name></package>")
    index = folder.parent / "ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (index / "course_sim").touch()
    run = simulate(more=store.fetched(wanted), executable=None, file="world.launch.py")
    assert run.ending is Ending.UNTIL and not run.faults
    assert judge("motion.drives", run, speed="0.2 m/s").status is Status.PASSED
    assert run.processes[0].survivors == ()
