"""Which ROS is used is a pure function of the environment."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader import ros
from grader.errors import GraderFault

SOURCED = {
    "ROS_DISTRO": "jazzy",
    "AMENT_PREFIX_PATH": "/home/ada/ws/install:/opt/ros/jazzy",
    "PYTHONPATH": "/opt/ros/jazzy/lib/python3.12/site-packages",
    "LD_LIBRARY_PATH": "/opt/ros/jazzy/lib",
    "HOME": "/home/ada",
    "SECRET": "x",
}


def prefix_with(folder: Path, *packages: str) -> Path:
    index = folder / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    for package in packages:
        (index / package).touch()
        (folder / "lib/python3.11/site-packages" / package).mkdir(parents=True)
    return folder


def test_the_wheels_are_used_when_nothing_is_sourced(tmp_path: Path) -> None:
    prefix = prefix_with(tmp_path, "rclpy", "std_msgs")
    found = ros.find({}, prefix, prefix / "bin/python")
    assert (found.source, found.prefixes) == ("wheels", (prefix,))
    assert found.packages == {"rclpy", "std_msgs"}
    assert found.python_modules == {"rclpy", "std_msgs"}


def test_a_sourced_jazzy_wins_over_the_wheels(tmp_path: Path) -> None:
    found = ros.find(SOURCED, prefix_with(tmp_path, "rclpy"))
    assert found.source == "sourced"
    assert found.prefixes == (Path("/home/ada/ws/install"), Path("/opt/ros/jazzy"))


def test_another_distribution_is_refused_by_name() -> None:
    with pytest.raises(GraderFault, match="ROS 2 humble is sourced, but rosgrade grades with"):
        ros.find({**SOURCED, "ROS_DISTRO": "humble"})


def test_no_ros_at_all_says_how_to_get_it(tmp_path: Path) -> None:
    with pytest.raises(GraderFault, match="make setup does it"):
        ros.find({}, tmp_path)


def test_a_child_sees_ros_and_its_overlay_and_nothing_else_of_the_shell(tmp_path: Path) -> None:
    overlay = prefix_with(tmp_path / "install", "bot_publisher")
    environment = ros.find(SOURCED).environment(SOURCED, (overlay,))
    assert "SECRET" not in environment
    assert environment["AMENT_PREFIX_PATH"].split(":")[0] == str(overlay)
    assert environment["PYTHONPATH"].split(":") == [
        str(overlay / "lib/python3.11/site-packages"),
        "/opt/ros/jazzy/lib/python3.12/site-packages",
    ]
    assert environment["LD_LIBRARY_PATH"].split(":") == [
        str(overlay / "lib"),
        "/opt/ros/jazzy/lib",
    ]


def test_children_on_wheels_do_not_start_python_twice(tmp_path: Path) -> None:
    prefix = prefix_with(tmp_path, "rclpy")
    libraries = prefix / "lib/python3.11/site-packages/ros_rcl.libs"
    libraries.mkdir()
    environment = ros.find({}, prefix).environment({})
    assert environment["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"
    assert environment["LD_LIBRARY_PATH"].split(":") == [str(prefix / "lib"), str(libraries)]
