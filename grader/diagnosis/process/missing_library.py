"""What a submission imports and what is not there where it is graded."""

from __future__ import annotations

import re

from grader.diagnosis.process.failure import Failure
from grader.recording.model import Recording
from grader.submission.read.rosdistro import PACKAGES, PYTHON_MODULES

_MISSING = re.compile(r"No module named '([A-Za-z_]\w*)'$")
# Packages without a Python module: a student who imports one means another, such as rclpy.
_WITHOUT_PYTHON = re.compile(r"rcl|rcl_.+|rclc.*|rcutils|rcpputils|rmw.*|ament_cmake.*|rosidl_.+")


def lacking_package(failure: Failure, recording: Recording) -> str | None:
    """The ROS package of Jazzy that an import wants and the installation lacks, or None.

    Right code runs where the package is installed, so its absence is not the student's fault.
    """
    found = _MISSING.match(failure.message)
    if failure.type != "ModuleNotFoundError" or found is None or found[1] not in PACKAGES:
        return None
    if found[1] not in PYTHON_MODULES and _WITHOUT_PYTHON.fullmatch(found[1]):
        return None
    own = {package.name for package in recording.submission.packages}
    # What is installed lacks only where the program hides it from itself.
    installed = recording.environment.get("ros_imports", "").split()
    return None if found[1] in {*own, *installed} else found[1]
