"""What the tests of submissions share: a ROS that is only named, and the real one."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.machine import ros as ros_module
from grader.machine.ros import RosInstallation
from tests.submission.samples import Tree


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    """An empty folder called ``alice`` to put a submission into."""
    root = tmp_path / "alice"
    root.mkdir()
    return Tree(root)


@pytest.fixture
def named_ros(tmp_path: Path) -> RosInstallation:
    """An installation that has names of packages, but nothing to build with."""
    prefix = tmp_path / "ros"
    index = prefix / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    for name in ("rclpy", "geometry_msgs", "std_msgs", "ament_cmake"):
        (index / name).touch()
        (prefix / "lib/python3.11/site-packages" / name).mkdir(parents=True)
    return RosInstallation(source="wheels", python=prefix / "bin/python", prefixes=(prefix,))


@pytest.fixture
def real_ros() -> RosInstallation:
    """The installation of this machine."""
    return ros_module.find()
