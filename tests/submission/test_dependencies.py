from __future__ import annotations

import pytest

from grader.submission.read.dependencies import is_known, meant
from grader.submission.read.rosdistro import PACKAGES, ROSDEP_KEYS


def known(name: str) -> bool | None:
    return is_known(name, installed=("rclpy", "std_msgs"), submitted=("bot_msgs",))


@pytest.mark.parametrize(
    "name",
    ["rclpy", "bot_msgs", "tf2_ros", "tf_transformations", "cv_bridge", "nav2_msgs", "ament_cmake"],
)
def test_packages_of_jazzy_are_known_whether_installed_or_not(name: str) -> None:
    assert known(name) is True


@pytest.mark.parametrize(
    "name", ["python3-numpy", "python3-pytest", "libopencv-dev", "eigen", "yaml-cpp", "boost"]
)
def test_rosdep_keys_are_never_judged_missing(name: str) -> None:
    assert known(name) is True


@pytest.mark.parametrize(
    ("name", "package"),
    [
        ("geometry_msg", "geometry_msgs"),
        ("geometry-msgs", "geometry_msgs"),
        ("Geometry_msgs", "geometry_msgs"),
        ("geometry_msgs.msg", "geometry_msgs"),
        ("geometry_msgs/msg", "geometry_msgs"),
        ("geomtery_msgs", "geometry_msgs"),
        ("sensors_msgs", "sensor_msgs"),
        ("std_msg", "std_msgs"),
        ("rclypy", "rclpy"),
        ("rcply", "rclpy"),
        ("cv-bridge", "cv_bridge"),
        ("ros-jazzy-rclpy", "rclpy"),
        ("bot_msg", "bot_msgs"),
    ],
)
def test_a_mistyped_known_name_is_wrong(name: str, package: str) -> None:
    assert known(name) is False
    assert meant(name, ("bot_msgs",)) == package


@pytest.mark.parametrize("name", ["rospy", "catkin", "my robot", "größe", "", "a/b", "$(x)"])
def test_packages_of_ros_1_and_what_cannot_be_a_name_are_wrong(name: str) -> None:
    assert known(name) is False


@pytest.mark.parametrize("name", ["acme_robot_driver", "pal_msgs", "x_msgs"])
def test_of_other_names_nothing_is_claimed(name: str) -> None:
    assert known(name) is None


def test_the_lists_hold_names_and_nothing_else() -> None:
    assert all(known(name) is True for name in PACKAGES | ROSDEP_KEYS)
    assert not any(set(name) & set("\"'/,()") for name in PACKAGES)
