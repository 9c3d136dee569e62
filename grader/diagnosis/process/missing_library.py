"""What a submission imports and what is not there where it is graded."""

from __future__ import annotations

import re

from grader.diagnosis.process.failure import Failure
from grader.recording.model import Recording
from grader.submission.read.rosdistro import LIBRARIES, PACKAGES, PYTHON_MODULES
from grader.submission.underlay.definition import ways_to_get

_MISSING = re.compile(r"No module named '([A-Za-z_]\w*)'$")
# Packages without a Python module: a student who imports one means another, such as rclpy.
_WITHOUT_PYTHON = re.compile(r"rcl|rcl_.+|rclc.*|rcutils|rcpputils|rmw.*|ament_cmake.*|rosidl_.+")


def lacking_here(failure: Failure, recording: Recording) -> tuple[str, str] | None:
    """What comes with ROS 2 Jazzy, is imported, and is not installed here; and how to get it.

    These are packages of ROS, and the Python libraries that they depend on. Right code runs where
    they are installed, so their absence is not the student's fault.
    """
    found = _MISSING.match(failure.message)
    if failure.type != "ModuleNotFoundError" or found is None:
        return None
    name = found[1]
    packages = recording.submission.packages
    sources = (source.module for package in packages for source in package.sources)
    own = {package.name for package in packages}.union(*(name.split(".") for name in sources))
    # What is installed lacks only where the program hides it from itself.
    if name in {*own, *recording.environment.get("ros_imports", "").split()}:
        return None
    if name in LIBRARIES:
        return name, f"`libraries: [{LIBRARIES[name]}]` in assignment.yaml"
    if name not in PACKAGES or (name not in PYTHON_MODULES and _WITHOUT_PYTHON.fullmatch(name)):
        return None
    apt = f"`sudo apt install ros-jazzy-{name.replace('_', '-')}`"
    return name, ways_to_get(PYTHON_MODULES.get(name, (name,))[-1:]) or apt
