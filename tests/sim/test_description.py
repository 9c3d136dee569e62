"""The YAML options."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import TypeAdapter

from grader.errors import AssignmentError
from grader.spec.source import parse_source
from sim.coordinates import RollPitchYaw
from sim.description import Layout, NoReturn, RobotOptions, SimulatorOptions
from sim.motion import Pose

FILE = Path("options.yaml")


def read(text: str) -> SimulatorOptions:
    return parse_source(text, FILE).read(SimulatorOptions)


def test_the_defaults_are_those_of_turtlebot3_in_gazebo() -> None:
    options = SimulatorOptions()
    assert options.robot.model == "burger"
    lidar = options.lidar
    assert (lidar.beams, lidar.rate, lidar.range_min, lidar.range_max) == (360, 5.0, 0.12, 3.5)
    assert (lidar.layout, lidar.no_return) == (Layout.FROM_ZERO, NoReturn.INF)
    assert (lidar.frame, lidar.noise) == ("base_scan", 0.0)
    odometry = options.odometry
    assert (odometry.rate, odometry.frame, odometry.child_frame) == (30.0, "odom", "base_footprint")
    topics = options.topics
    assert topics.command.type == "geometry_msgs/msg/Twist"
    for topic, name in (
        (topics.command, "/cmd_vel"),
        (topics.odometry, "/odom"),
        (topics.scan, "/scan"),
    ):
        assert topic.topic == name
        assert (topic.reliability, topic.durability, topic.depth) == ("reliable", "volatile", 10)
    assert not topics.clock.enabled


def test_everything_can_be_set_in_yaml() -> None:
    options = read(
        """
robot: {model: waffle, pose: [1, 20 cm, 90 deg], command_timeout: 500 ms}
lidar:
  layout: -pi..pi
  no_return: zero
  noise: 5 mm
  pose: [-3.2 cm, 0, 0]
  stops: 8 s
odometry: {origin: start, drift: {radius: 1 %, slip: 2 mm}, covariance: {yaw: 0.5}}
topics:
  command: {type: geometry_msgs/msg/TwistStamped}
  scan: {reliability: best_effort, depth: 5}
  clock: {enabled: true}
"""
    )
    assert options.robot.pose == Pose(1.0, pytest.approx(0.2), pytest.approx(1.5707963267948966))
    assert options.lidar.layout is Layout.FROM_MINUS_PI
    assert options.lidar.no_return is NoReturn.ZERO
    assert options.lidar.pose == Pose(-0.032, 0.0, 0.0)
    assert options.lidar.noise == pytest.approx(0.005)
    assert options.odometry.drift.slip == pytest.approx(0.002)
    assert options.odometry.covariance.yaw == 0.5
    assert options.topics.scan.reliability == "best_effort"
    assert options.topics.command.type.endswith("TwistStamped")


def test_options_survive_being_written_and_read() -> None:
    options = read("robot: {pose: [1, 2, 90 deg], max_speed: 1 m/s}\nlidar: {noise: 1 cm}")
    assert SimulatorOptions.model_validate_json(options.model_dump_json()) == options


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "lidar:\n  beans: 3",
            r"options.yaml:2: lidar.beans: unknown key 'beans'. Did you mean 'be",
        ),
        ("lidar: {beams: 0}", r"options.yaml:1: lidar.beams: must be at least 1, not 0"),
        ("lidar: {rate: 200 Hz}", r"lidar.rate: must be at most 100"),
        ("lidar: {range_min: 4}", r"lidar: range_min must be less than range_max"),
        ("lidar: {layout: 2pi}", r"lidar.layout: expected '0..2pi' or '-pi..pi', not '2pi'"),
        ("lidar: {noise: -1 mm}", r"lidar.noise: '-1 mm' is too small: it must be at least 0"),
        (
            "robot: {model: bugrer}",
            r"robot.model: expected 'burger' or 'waffle', not 'bugrer'. Did",
        ),
        ("robot: {max_speed: 0 m/s}", r"robot.max_speed: '0 m/s' is too small: it must be more"),
        ("topics: {scan: {topic: scan}}", r"topics.scan.topic: 'scan' is relative"),
        ("topics: {command: {type: geometry_msgs/msg/Twst}}", r"topics.command.type: expected"),
    ],
)
def test_a_mistake_is_reported_with_file_and_line(text: str, message: str) -> None:
    with pytest.raises(AssignmentError, match=message):
        read(text)


def test_reading_a_world_needs_neither_ros_nor_numpy() -> None:
    program = (
        "import sys, sim.world, sim.description, sim.simulation as _\n"
        "sys.exit('rclpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
    program = "import sys, sim.world, sim.description\nsys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_the_fixed_frames_are_those_of_a_turtlebot3() -> None:
    burger = SimulatorOptions()
    assert [(parent, child) for parent, child, *_ in burger.fixed_frames] == [
        ("base_footprint", "base_link"),
        ("base_link", "base_scan"),
    ]
    waffle = SimulatorOptions.model_validate(
        {"robot": {"model": "waffle"}, "odometry": {"child_frame": "base_link"}}
    )
    [(parent, child, _, height_m)] = waffle.fixed_frames
    assert (parent, child, height_m) == ("base_link", "base_scan", 0.122)


def test_roll_pitch_and_yaw_are_written_as_they_are_read() -> None:
    angles = TypeAdapter(RollPitchYaw)
    read = angles.validate_python([0, "90 deg", "0.5 rad"])
    assert angles.validate_json(angles.dump_json(read)) == read


def test_a_camera_has_a_body_and_an_optical_frame_and_each_robot_its_own() -> None:
    options = SimulatorOptions.model_validate(
        {"camera": {"pitch": "60 deg", "position": [0.1, 0, "20 cm"], "objects": {}}}
    )
    [body, optical] = options.camera_frames
    assert body[:3] == ("base_link", "camera_link", (0.1, 0.0, 0.2))
    assert body[3] == pytest.approx((0.0, 0.5, 0.0, 0.75**0.5))
    assert optical == (
        *("camera_link", "camera_rgb_optical_frame"),
        *((0.0, 0.0, 0.0), (-0.5, 0.5, -0.5, 0.5)),
    )
    assert ("base_link", "camera_link") in options.transforms
    assert SimulatorOptions().camera_frames == []
    own = options.each({"tb1": RobotOptions(), "tb2": RobotOptions()})["tb2"]
    assert own.camera is not None
    assert own.camera.topics == (
        "/tb2/camera/image_raw",
        "/tb2/camera/image_raw/compressed",
        "/tb2/camera/camera_info",
        "/tb2/camera/objects",
    )
    assert [frames[:2] for frames in own.camera_frames] == [
        ("tb2/base_link", "tb2/camera_link"),
        ("tb2/camera_link", "tb2/camera_rgb_optical_frame"),
    ]
