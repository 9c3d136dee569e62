"""An import that only this machine lacks is told from a wrong one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from grader.diagnosis.process import missing_library
from grader.diagnosis.process.failure import Failure
from grader.recording.model import Ending, Recording
from grader.recording.submission import PackageRecord, SourceFile, SubmissionRecord


def lacking_package(message: str, recording: Recording) -> str | None:
    failure = Failure("ModuleNotFoundError", message, ())
    found = missing_library.lacking_here(failure, recording)
    return found and found[0]


def run() -> Recording:
    packages = (PackageRecord(name="robot_tools", path="."),)
    return Recording(
        scenario="run",
        seed=1,
        ending=Ending.EXITED,
        launched_ns=0,
        stop_ns=1,
        end_ns=2,
        submission=SubmissionRecord(id="ada", sha256="ab" * 32, packages=packages),
    )


@pytest.mark.parametrize("name", ["tf_transformations", "rosidl_runtime_py", "rcl_interfaces"])
def test_a_package_of_ros_that_is_not_installed_here_is_not_the_student_s_fault(name: str) -> None:
    assert lacking_package(f"No module named '{name}'", run()) == name


@pytest.mark.parametrize("name", ["transforms3d", "cv2", "PIL"])
def test_a_library_on_which_packages_of_ros_depend_is_judged_as_they_are(name: str) -> None:
    assert lacking_package(f"No module named '{name}'", run()) == name


def test_an_own_module_that_is_not_found_is_the_student_s_whatever_its_name() -> None:
    sources = (SourceFile("robot_tools/serial.py", "robot_tools.serial"),)
    package = PackageRecord(name="robot_tools", path=".", sources=sources)
    own = replace(run(), submission=replace(run().submission, packages=(package,)))
    assert lacking_package("No module named 'serial'", own) is None


@pytest.mark.parametrize(
    "message",
    [
        "No module named 'transform3d'",
        "No module named 'tf_transformation'",
        "No module named 'geometry_msgs.msgs'",
        "No module named 'rclcpp'",
        "No module named 'rosidl_cmake'",
        "No module named 'robot_tools'",
        "No module named 'pandas'",
    ],
)
def test_a_wrong_name_of_a_package_or_module_is_the_student_s(message: str) -> None:
    assert lacking_package(message, run()) is None


def test_a_package_that_is_there_lacks_only_where_a_program_hides_it_from_itself() -> None:
    message = "No module named 'nav2_msgs'"
    assert lacking_package(message, run()) == "nav2_msgs"
    installed = replace(run(), environment={"ros_imports": "rclpy nav2_msgs"})
    assert lacking_package(message, installed) is None
