"""Which ROS is used is a pure function of the environment."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from grader.errors import GraderFault
from grader.machine import ros


def prefix_with(folder: Path, *packages: str) -> Path:
    index = folder / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    for package in packages:
        (index / package).touch()
        (folder / "lib/python3.11/site-packages" / package).mkdir(parents=True)
    return folder


def sourced(*prefixes: Path) -> dict[str, str]:
    """A shell in which these are sourced, the last of them first."""
    sites = [site for prefix in prefixes for site in ros.site_packages(prefix)]
    return {
        "ROS_DISTRO": "jazzy",
        "AMENT_PREFIX_PATH": ":".join(map(str, prefixes)),
        "PYTHONPATH": ":".join(map(str, sites)),
        "LD_LIBRARY_PATH": ":".join(f"{prefix}/lib" for prefix in prefixes),
        "HOME": "/home/ada",
        "SECRET": "x",
    }


@pytest.fixture
def jazzy(tmp_path: Path) -> Path:
    return prefix_with(tmp_path / "jazzy", "rclpy", "std_msgs")


def test_the_wheels_are_used_when_nothing_is_sourced(tmp_path: Path) -> None:
    prefix = prefix_with(tmp_path, "rclpy", "std_msgs")
    found = ros.find({}, prefix, prefix / "bin/python")
    assert (found.source, found.prefixes) == ("wheels", (prefix,))
    assert found.packages == {"rclpy", "std_msgs"}
    assert found.python_modules == {"rclpy", "std_msgs"}


def test_a_sourced_jazzy_wins_over_the_wheels(jazzy: Path, tmp_path: Path) -> None:
    found = ros.find(sourced(jazzy), prefix_with(tmp_path / "venv", "rclpy"))
    assert (found.source, found.prefixes) == ("sourced", (jazzy,))
    assert found.notice == ""


def test_a_workspace_that_is_sourced_is_no_part_of_ros_and_is_named(
    jazzy: Path, tmp_path: Path
) -> None:
    merged = prefix_with(tmp_path / "merged", "bot_solution", "rclpy")
    isolated = [prefix_with(tmp_path / "ws" / name, name) for name in ("sim", "grader")]
    shell = sourced(*isolated, merged, jazzy)
    found = ros.find(shell)
    assert found == replace(ros.find(sourced(jazzy)), left_out=(tmp_path / "ws", merged))
    assert f"left out: {tmp_path / 'ws'}, {merged} (sourced" in found.notice
    child = found.environment(shell)
    assert not [text for text in child.values() if str(merged) in text or "/ws/" in text]


def test_a_jazzy_that_was_built_from_source_is_all_of_its_prefixes(tmp_path: Path) -> None:
    built = [prefix_with(tmp_path / "jazzy" / name, name) for name in ("std_msgs", "rclpy")]
    workspace = prefix_with(tmp_path / "ws", "bot")
    found = ros.find(sourced(workspace, *built))
    assert found.prefixes == tuple(built)
    assert found.packages == {"rclpy", "std_msgs"}


def test_a_sourced_jazzy_without_rclpy_says_what_to_install(tmp_path: Path) -> None:
    with pytest.raises(GraderFault, match="sudo apt install ros-jazzy-rclpy"):
        ros.find(sourced(prefix_with(tmp_path, "std_msgs")))


def test_a_child_finds_what_ros_and_underlays_install_for_a_shell(
    jazzy: Path, tmp_path: Path
) -> None:
    underlay = tmp_path / "ros2cli"
    found = replace(ros.find(sourced(jazzy)), underlays=(underlay,))
    path = found.environment({})["PATH"].split(":")
    assert path[1:3] == [f"{underlay}/bin", f"{jazzy}/bin"]
    assert path[0] == str(found.python.parent)


def test_another_distribution_is_refused_by_name() -> None:
    with pytest.raises(GraderFault, match="ROS 2 humble is sourced, but rosgrade grades with"):
        ros.find({**sourced(Path("/opt/ros/humble")), "ROS_DISTRO": "humble"})


def test_no_ros_at_all_says_how_to_get_it(tmp_path: Path) -> None:
    with pytest.raises(GraderFault, match="make setup does it"):
        ros.find({}, tmp_path)


def test_a_child_sees_ros_and_its_overlay_and_nothing_else_of_the_shell(
    jazzy: Path, tmp_path: Path
) -> None:
    overlay, shell = prefix_with(tmp_path / "install", "bot_publisher"), sourced(jazzy)
    environment = ros.find(shell).environment(shell, (overlay,))
    assert "SECRET" not in environment
    assert environment["AMENT_PREFIX_PATH"].split(":")[0] == str(overlay)
    assert environment["PYTHONPATH"].split(":") == [
        str(overlay / "lib/python3.11/site-packages"),
        str(jazzy / "lib/python3.11/site-packages"),
    ]
    assert environment["LD_LIBRARY_PATH"].split(":") == [f"{overlay}/lib", f"{jazzy}/lib"]


def test_children_on_wheels_do_not_start_python_twice(tmp_path: Path) -> None:
    prefix = prefix_with(tmp_path, "rclpy")
    libraries = prefix / "lib/python3.11/site-packages/ros_rcl.libs"
    libraries.mkdir()
    environment = ros.find({}, prefix).environment({})
    assert environment["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"
    assert environment["LD_LIBRARY_PATH"].split(":") == [str(prefix / "lib"), str(libraries)]
