"""The simulator on real topics, in a domain of its own."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

import rclpy
from geometry_msgs.msg import Twist as TwistMessage
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import (
    BatteryState,
    CameraInfo,
    CompressedImage,
    Image,
    Imu,
    JointState,
    LaserScan,
    Range,
)
from visualization_msgs.msg import MarkerArray

from grader.run.cell.domain import lock_domain
from sim.description import SimulatorOptions
from sim.motion import NS, Pose, Twist
from sim.node import RosSimulator, make_node
from sim.pacing import MAX_AHEAD, Lateness
from sim.png import png
from sim.simulation import STEP_NS, EventKind, Step, make_simulation
from sim.world import parse_world

pytestmark = [
    pytest.mark.ros,
    # lark, which rclpy's interfaces import, still uses it.
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),
]

LIMIT_S = 20.0
ROOM = parse_world("bounds: [-1, -2, 3, 4]")
PICTURE = np.arange(24 * 32 * 3, dtype=np.uint8).reshape(24, 32, 3)


class Truth:
    """A sink that keeps everything."""

    def __init__(self) -> None:
        self.steps: list[Step] = []
        self.stamps: list[int] = []
        self.late: list[Lateness] = []

    def on_step(self, step: Step, stamp_ns: int, robot: str) -> None:
        self.steps.append(step)
        self.stamps.append(stamp_ns)

    def on_late(self, lateness: Lateness) -> None:
        self.late.append(lateness)


class Bench:
    """A simulator on a clock that the test sets, and a student's node beside it."""

    def __init__(self, domain_id: int) -> None:
        self.now_ns = 0
        self.domain_id = domain_id
        self.context = self.make_context()
        self.node: Any = make_node("simulator", self.context)
        # A participant of its own, as that of another process.
        self.outside = self.make_context()
        self.student: Any = rclpy.create_node("student", context=self.outside)
        self.executor = SingleThreadedExecutor(context=self.outside)
        self.executor.add_node(self.student)
        self.truth = Truth()

    def make_context(self) -> Context:
        context = Context()
        rclpy.init(context=context, domain_id=self.domain_id)
        return context

    def simulator(self, *, recorders: int = -1, **options: object) -> RosSimulator:
        simulation = make_simulation(ROOM, SimulatorOptions.model_validate(options))
        return RosSimulator(self.node, {"": simulation}, self.truth, lambda: self.now_ns, recorders)

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        """Serve the student's node until something holds."""
        end_s = time.monotonic() + LIMIT_S
        while not condition():
            assert time.monotonic() < end_s, f"no {what} within {LIMIT_S} s"
            self.executor.spin_once(timeout_sec=0.05)

    def listen(self, kind: Any, topic: str, qos: Any = 10) -> list[Any]:
        received: list[Any] = []
        self.student.create_subscription(kind, topic, received.append, qos)
        return received

    def step(self, simulator: RosSimulator, steps: int = 1) -> None:
        for _ in range(steps):
            self.now_ns += STEP_NS
            simulator.catch_up()

    def close(self) -> None:
        self.executor.shutdown()
        self.student.destroy_node()
        self.node.destroy_node()
        self.context.try_shutdown()
        self.outside.try_shutdown()


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.delenv("ROS_STATIC_PEERS", raising=False)
    with lock_domain() as lock:
        subject = Bench(lock.domain_id)
        yield subject
        subject.close()


def command(v: float, w: float) -> TwistMessage:
    message = TwistMessage()
    message.linear.x, message.angular.z = v, w
    return message


def test_odometry_is_published_on_time_as_soon_as_another_than_the_recorder_hears_it(
    bench: Bench,
) -> None:
    simulator = bench.simulator(recorders=1, lidar={"enabled": False})
    recorded = bench.listen(Odometry, "/odom", 100)
    count = simulator.robots[""].odometry.publisher.get_subscription_count
    bench.wait(lambda: count() == 1, "match")
    simulator.start()
    bench.now_ns = STEP_NS
    together_ns = simulator.catch_up()
    assert together_ns == STEP_NS + MAX_AHEAD * STEP_NS
    bench.listen(Odometry, "/odom")
    bench.wait(lambda: count() == 2, "second match")
    bench.now_ns = together_ns
    assert simulator.catch_up() == 14 * STEP_NS
    bench.wait(lambda: len(recorded) == 3, "odometry")
    stamps = [one.header.stamp.nanosec for one in recorded]
    assert [(later - sooner) % NS for sooner, later in pairwise(stamps)] == [30_000_000] * 2


@pytest.mark.parametrize("continuous", [False, True])
def test_beyond_half_a_turn_the_quaternion_goes_on_or_has_no_negative_w(
    bench: Bench, continuous: bool
) -> None:
    simulator = bench.simulator(
        robot={"drives": [{"at": "0 s", "angular": "2.8 rad/s"}]},
        lidar={"enabled": False},
        odometry={"continuous": continuous},
    )
    odometry = bench.listen(Odometry, "/odom")
    bench.wait(
        lambda: simulator.robots[""].odometry.publisher.get_subscription_count() == 1, "match"
    )
    for _ in range(20):
        bench.step(simulator, 10)
        number = sum(step.odometry is not None for step in bench.truth.steps)
        bench.wait(lambda number=number: len(odometry) == number, "odometry")
    sent = [step for step in bench.truth.steps if step.odometry is not None]
    told = [message.pose.pose.orientation for message in odometry]
    turns = [a.z * b.z + a.w * b.w for a, b in pairwise(told)]
    assert (min(turns) > 0.9, min(q.w for q in told) < 0.0) == (continuous, continuous)
    for quaternion, step in zip(told, sent, strict=True):
        off_rad = 2.0 * math.atan2(quaternion.z, quaternion.w) - step.pose.yaw_rad
        assert math.remainder(off_rad, math.tau) == pytest.approx(0.0, abs=1e-6)


def test_a_student_drives_and_sees(bench: Bench) -> None:
    """In real time: commands in, odometry and scans out, with the truth beside them."""
    simulator = RosSimulator(
        bench.node, {"": make_simulation(ROOM, SimulatorOptions())}, bench.truth
    )
    odometry = bench.listen(Odometry, "/odom")
    scans = bench.listen(LaserScan, "/scan")
    publisher = bench.student.create_publisher(TwistMessage, "/cmd_vel", 10)
    bench.wait(
        lambda: (
            publisher.get_subscription_count() == 1
            and simulator.robots[""].odometry.publisher.get_subscription_count() == 1
            and simulator.robots[""].scan.publisher.get_subscription_count() == 1
        ),
        "match",
    )
    stop = threading.Event()
    loop = threading.Thread(target=simulator.run, args=(stop,))
    loop.start()
    try:
        publisher.publish(command(0.2, 0.5))
        bench.wait(lambda: len(odometry) >= 20 and len(scans) >= 3, "odometry and scans")
    finally:
        stop.set()
        loop.join(LIMIT_S)
    assert not loop.is_alive()

    truth = {stamp: step for step, stamp in zip(bench.truth.steps, bench.truth.stamps, strict=True)}
    for message in odometry:
        assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_footprint")
        step = truth[message.header.stamp.sec * NS + message.header.stamp.nanosec]
        pose = message.pose.pose
        assert (pose.position.x, pose.position.y) == (step.pose.x_m, step.pose.y_m)
        yaw = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        assert yaw == pytest.approx(step.pose.yaw_rad)
        assert message.twist.twist.linear.x == step.twist.linear_m_s
        assert message.twist.twist.angular.z == step.twist.angular_rad_s
    covariance = odometry[0].pose.covariance
    assert [covariance[7 * i] for i in range(6)] == [1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3]
    scan = scans[0]
    assert scan.header.frame_id == "base_scan"
    assert (scan.angle_min, len(scan.ranges)) == (0.0, 360)
    assert scan.angle_increment == pytest.approx(math.tau / 360)
    assert scan.angle_max == pytest.approx(359 * math.tau / 360)
    assert (scan.range_min, scan.range_max) == (pytest.approx(0.12), 3.5)
    assert (scan.scan_time, scan.time_increment) == (pytest.approx(0.2), 0.0)
    taken = truth[scan.header.stamp.sec * NS + scan.header.stamp.nanosec].scan
    assert taken is not None
    assert scan.ranges.tobytes() == taken.ranges_m.tobytes()
    assert scan.intensities.tobytes() == taken.intensities.tobytes()
    moving = bench.truth.steps[-1]
    assert moving.command == Twist(0.2, 0.5)
    assert moving.pose != Pose(0.0, 0.0, 0.0)
    # Simulated time is what it says, to the step.
    assert [step.index for step in bench.truth.steps] == list(range(1, moving.index + 1))
    begin_ns = bench.truth.stamps[0] - STEP_NS
    assert bench.truth.stamps == [begin_ns + step.time_ns for step in bench.truth.steps]


def test_every_topic_has_the_qos_of_the_yaml(bench: Bench) -> None:
    bench.simulator(
        topics={
            "scan": {"reliability": "best_effort", "topic": "/lidar"},
            "odometry": {"durability": "transient_local"},
            "clock": {"enabled": True},
            "command": {"reliability": "best_effort"},
        }
    )
    qos = {}
    for topic in ("/lidar", "/odom", "/clock"):
        (info,) = bench.node.get_publishers_info_by_topic(topic)
        qos[topic] = (info.qos_profile.reliability, info.qos_profile.durability)
    best, reliable = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
    assert qos == {
        "/lidar": (best, DurabilityPolicy.VOLATILE),
        "/odom": (reliable, DurabilityPolicy.TRANSIENT_LOCAL),
        "/clock": (reliable, DurabilityPolicy.VOLATILE),
    }
    (info,) = bench.node.get_subscriptions_info_by_topic("/cmd_vel")
    assert info.qos_profile.reliability == best


def test_a_command_acts_from_the_first_step_that_begins_after_it_arrived(bench: Bench) -> None:
    """However many steps are done together."""
    simulator = bench.simulator()
    publisher = bench.student.create_publisher(TwistMessage, "/cmd_vel", 10)
    bench.wait(lambda: publisher.get_subscription_count() == 1, "match")
    simulator.start()
    sent: list[tuple[int, int]] = []
    for speed in (0.1, 0.15, 0.2):
        began_ns = time.time_ns()
        publisher.publish(command(speed, 0.0))
        # One that waits for a busy machine would arrive together with the next.
        assert publisher.wait_for_all_acked(Duration(seconds=LIMIT_S))
        acked_ns = time.time_ns()
        sent.append((began_ns, acked_ns))
        bench.wait(lambda at=acked_ns: time.time_ns() > at + 3 * STEP_NS, "time")
    bench.now_ns = time.time_ns() - sent[0][0] + 3 * STEP_NS
    simulator.catch_up()
    assert simulator.robots[""].commands == 3
    speeds = [step.command.linear_m_s for step in bench.truth.steps]
    for speed, (began_ns, acked_ns) in zip((0.1, 0.15, 0.2), sent, strict=True):
        begins_ns = bench.truth.stamps[speeds.index(speed)] - STEP_NS
        assert began_ns <= begins_ns <= acked_ns + STEP_NS


def test_commands_that_are_not_finite_are_rejected_and_the_simulator_goes_on(bench: Bench) -> None:
    simulator = bench.simulator()
    publisher = bench.student.create_publisher(TwistMessage, "/cmd_vel", 10)
    bench.wait(lambda: publisher.get_subscription_count() == 1, "match")
    for bad in (math.nan, math.inf, -math.inf):
        publisher.publish(command(bad, 0.0))
        bench.truth.steps.clear()
        bench.wait(
            lambda: bench.step(simulator) or any(step.events for step in bench.truth.steps), "event"
        )
        last = bench.truth.steps[-1]
        assert [event.kind for event in last.events] == [EventKind.COMMAND_REJECTED]
        assert last.command == Twist(0.0, 0.0)
    publisher.publish(command(0.1, 0.0))
    bench.wait(lambda: bench.step(simulator) or bench.truth.steps[-1].command.linear_m_s > 0, "cmd")
    assert math.isfinite(bench.truth.steps[-1].pose.x_m)


def test_a_flood_of_commands_does_not_hold_it_up(bench: Bench) -> None:
    """20,000 at once; each step takes what the queue keeps and no more."""
    simulator = bench.simulator(topics={"command": {"reliability": "best_effort"}})
    publisher = bench.student.create_publisher(TwistMessage, "/cmd_vel", 10)
    bench.wait(lambda: publisher.get_subscription_count() == 1, "match")
    bench.step(simulator)
    message = command(0.0, 0.0)
    for i in range(20_000):
        message.linear.x = 1e-6 * i
        publisher.publish(message)
        if i % 100 == 0:
            before = simulator.robots[""].commands
            bench.step(simulator)
            assert simulator.robots[""].commands - before <= 100
    message.linear.x = 0.2
    bench.wait(
        lambda: (
            publisher.publish(message)
            or bench.step(simulator)
            or bench.truth.steps[-1].command.linear_m_s == 0.2
        ),
        "last command",
    )


def test_a_command_of_the_other_type_does_not_match(bench: Bench) -> None:
    simulator = bench.simulator()
    wrong = bench.student.create_publisher(TwistStamped, "/cmd_vel", 10)
    third = bench.make_context()
    node: Any = rclpy.create_node("other_student", context=third)
    right = node.create_publisher(TwistMessage, "/cmd_vel", 10)
    bench.wait(lambda: right.get_subscription_count() == 1, "match")
    bench.wait(lambda: len(bench.node.get_publishers_info_by_topic("/cmd_vel")) == 2, "discovery")
    assert wrong.get_subscription_count() == 0
    assert simulator.robots[""].unheard == ("geometry_msgs/msg/TwistStamped",)
    wrong.publish(TwistStamped())
    right.publish(command(0.1, 0.0))
    bench.wait(lambda: bench.step(simulator) or simulator.robots[""].commands == 1, "command")
    node.destroy_node()
    third.try_shutdown()


def test_stamped_commands_are_obeyed_where_the_yaml_says_so(bench: Bench) -> None:
    simulator = bench.simulator(topics={"command": {"type": "geometry_msgs/msg/TwistStamped"}})
    publisher = bench.student.create_publisher(TwistStamped, "/cmd_vel", 10)
    bench.wait(lambda: publisher.get_subscription_count() == 1, "match")
    message = TwistStamped()
    message.twist = command(0.1, 0.2)
    publisher.publish(message)
    bench.wait(lambda: bench.step(simulator) or simulator.robots[""].commands == 1, "command")
    bench.step(simulator)
    assert bench.truth.steps[-1].command == Twist(0.1, 0.2)


def test_an_executor_that_spins_its_node_takes_no_commands(bench: Bench) -> None:
    simulator = bench.simulator()
    executor = SingleThreadedExecutor(context=bench.context)
    executor.add_node(bench.node)
    publisher = bench.student.create_publisher(TwistMessage, "/cmd_vel", 10)
    bench.wait(lambda: publisher.get_subscription_count() == 1, "match")
    publisher.publish(command(0.1, 0.0))
    for _ in range(10):
        executor.spin_once(timeout_sec=0.02)
    bench.wait(lambda: bench.step(simulator) or simulator.robots[""].commands == 1, "command")
    executor.shutdown()


def test_the_clock_is_that_of_the_stamps(bench: Bench) -> None:
    simulator = bench.simulator(topics={"clock": {"enabled": True, "depth": 100}})
    clock = bench.listen(Clock, "/clock", QoSProfile(depth=100))
    bench.wait(lambda: simulator.clock.publisher.get_subscription_count() == 1, "match")
    simulator.start()
    bench.step(simulator, 20)
    bench.wait(lambda: len(clock) == 20, "clock")
    assert [m.clock.sec * NS + m.clock.nanosec for m in clock] == bench.truth.stamps


def test_its_node_offers_nothing_that_could_disturb_it(bench: Bench) -> None:
    bench.simulator()
    assert bench.node.get_service_names_and_types_by_node("simulator", "/") == []
    published = bench.node.get_publisher_names_and_types_by_node("simulator", "/")
    assert "/rosout" not in dict(published)
    subscribed = bench.node.get_subscriber_names_and_types_by_node("simulator", "/")
    assert set(dict(subscribed)) == {"/cmd_vel"}


def test_the_loop_ends_with_its_context(bench: Bench) -> None:
    simulator = RosSimulator(
        bench.node, {"": make_simulation(ROOM, SimulatorOptions())}, bench.truth
    )
    loop = threading.Thread(target=simulator.run, args=(threading.Event(),))
    loop.start()
    bench.wait(lambda: bool(bench.truth.steps), "step")
    bench.context.try_shutdown()
    loop.join(LIMIT_S)
    assert not loop.is_alive()


def test_the_other_sensors_of_a_turtlebot_arrive_with_their_units(bench: Bench) -> None:
    simulator = bench.simulator(
        robot={"drives": [{"at": "0 s", "linear": "0.1 m/s", "angular": "0.5 rad/s"}]},
        lidar={"enabled": False},
        odometry={"enabled": False},
        imu={"noise": {"angular": "0 rad/s", "linear": "0.5 m/s^2"}},
        joint_states={},
        battery={"charge": "50 %"},
        ranges=[{"topic": "/sonar", "frame": "sonar_link", "radiation": "infrared"}],
    )
    kinds = {"/imu": Imu, "/joint_states": JointState, "/battery_state": BatteryState}
    heard = {topic: bench.listen(kind, topic) for topic, kind in {**kinds, "/sonar": Range}.items()}
    publishers = [one.publisher for one in simulator.robots[""].sensors.values()]
    bench.wait(lambda: all(one.get_subscription_count() == 1 for one in publishers), "match")
    simulator.start()
    for tenth in range(1, 11):
        bench.step(simulator, 10)
        bench.wait(lambda tenth=tenth: len(heard["/imu"]) == 5 * tenth, "an IMU")
    bench.wait(lambda: all(heard.values()), "messages")
    imu, joints, battery, sonar = (heard[topic][-1] for topic in heard)
    assert imu.header.frame_id == "imu_link"
    assert imu.angular_velocity.z == pytest.approx(0.5)
    assert imu.linear_acceleration_covariance[0] == pytest.approx(0.25)
    assert list(joints.name) == ["wheel_left_joint", "wheel_right_joint"]
    assert list(joints.velocity) == pytest.approx([0.06 / 0.033, 0.14 / 0.033])
    assert battery.percentage == pytest.approx(0.5, abs=1e-3)
    assert battery.voltage == pytest.approx(11.25, abs=1e-2)
    assert math.isnan(battery.current)
    assert (sonar.radiation_type, sonar.max_range) == (Range.INFRARED, 4.0)
    assert 2.0 < sonar.range < 3.1


def test_a_camera_makes_pictures_only_while_somebody_subscribes(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulator = bench.simulator(
        lidar={"enabled": False}, camera={"width": 32, "height": 24, "encoding": "bgr8"}
    )
    camera = simulator.robots[""].camera
    assert camera is not None
    made = []
    monkeypatch.setattr(camera._camera, "picture", lambda *at: made.append(at) or PICTURE)
    simulator.start()
    bench.step(simulator, 20)
    assert made == []
    images = bench.listen(Image, "/camera/image_raw")
    infos = bench.listen(CameraInfo, "/camera/camera_info")
    counts = camera.image.get_subscription_count, camera.info.get_subscription_count
    bench.wait(lambda: all(count() == 1 for count in counts), "match")
    bench.step(simulator, 20)
    bench.wait(lambda: len(images) == len(infos) == 2, "pictures")
    assert [time_ns for _, time_ns in made] == [300_000_000, 400_000_000]
    image, info = images[-1], infos[-1]
    assert (image.height, image.width, image.step, image.encoding) == (24, 32, 96, "bgr8")
    assert bytes(image.data) == PICTURE[..., ::-1].tobytes()
    assert image.header == info.header
    assert image.header.frame_id == "camera_rgb_optical_frame"
    focal = 16 / math.tan(1.02974 / 2)
    assert list(info.k) == pytest.approx([focal, 0, 15.5, 0, focal, 11.5, 0, 0, 1])
    assert list(info.p) == pytest.approx([focal, 0, 15.5, 0, 0, focal, 11.5, 0, 0, 0, 1, 0])
    assert (info.distortion_model, list(info.d)) == ("plumb_bob", [0.0] * 5)


def test_compressed_pictures_and_the_logical_camera(bench: Bench) -> None:
    box = "boxes: [{centre: [1, 0], size: [0.2, 0.1], colour: red, yaw: 20 deg}]"
    options = {"camera": {"objects": {}, "pitch": "10 deg"}}
    simulation = make_simulation(parse_world(box), SimulatorOptions.model_validate(options))
    simulator = RosSimulator(bench.node, {"": simulation}, None, lambda: bench.now_ns)
    pictures = bench.listen(CompressedImage, "/camera/image_raw/compressed")
    told = bench.listen(MarkerArray, "/camera/objects")
    camera = simulator.robots[""].camera
    assert camera is not None
    counts = camera.compressed.get_subscription_count, camera.objects.get_subscription_count
    bench.wait(lambda: all(count() == 1 for count in counts), "match")
    simulator.start()
    bench.step(simulator, 10)
    bench.wait(lambda: bool(pictures and told), "pictures")
    assert pictures[0].format == "rgb8; png compressed bgr8"
    assert simulation.camera is not None
    assert bytes(pictures[0].data) == png(simulation.camera.picture(simulation.pose, 10 * STEP_NS))
    [marker] = told[0].markers
    assert (marker.ns, marker.id, marker.type) == ("box", 0, marker.CUBE)
    assert marker.header.frame_id == "camera_link"
    assert (marker.color.r, marker.color.g) == (1.0, 0.0)
    # The camera looks 10 degrees down, so that the box is turned up from it.
    place, q = marker.pose.position, marker.pose.orientation
    ahead = (2 * (q.w * q.y + q.x * q.z), 2 * (q.y * q.z - q.w * q.x), 1 - 2 * (q.x**2 + q.y**2))
    assert ahead == pytest.approx((-math.sin(math.radians(10)), 0.0, math.cos(math.radians(10))))
    assert math.hypot(place.x, place.y, place.z) == pytest.approx(
        math.dist((1.0, 0.0, 0.25), (0.069, -0.047, 0.117))
    )
