"""What a submission imports and what is not there where it is graded."""

from __future__ import annotations

import re

from grader.diagnosis.process.failure import Failure
from grader.findings.wording import code, codes
from grader.recording.model import Recording
from grader.spec.nearest_name import nearest
from grader.submission.read.rosdistro import PACKAGES, PYTHON_MODULES

_MISSING = re.compile(r"No module named '([A-Za-z_]\w*)")
_MISSING_ROOT = re.compile(r"No module named '([A-Za-z_]\w*)'$")
# Packages without a Python module: a student who imports one means another, such as rclpy.
_WITHOUT_PYTHON = re.compile(r"rcl|rcl_.+|rclc.*|rcutils|rcpputils|rmw.*|ament_cmake.*|rosidl_.+")


def lacking_package(failure: Failure, recording: Recording) -> str | None:
    """The ROS package of Jazzy that an import wants and the installation lacks, or None.

    Right code runs where the package is installed, so its absence is not the student's fault.
    """
    found = _MISSING_ROOT.match(failure.message)
    if failure.type != "ModuleNotFoundError" or found is None or found[1] not in PACKAGES:
        return None
    if found[1] not in PYTHON_MODULES and _WITHOUT_PYTHON.fullmatch(found[1]):
        return None
    own = {package.name for package in recording.submission.packages}
    # What is installed lacks only where the program hides it from itself.
    installed = recording.environment.get("ros_imports", "").split()
    return None if found[1] in {*own, *installed} else found[1]


def library_hint(message: str, recording: Recording) -> str | None:
    """What to do about an import of a library that is not among those of the assignment.

    Returns:
        A hint, or None where the name is rather that of a package of the student's or of ROS, and
        where the run was in no sandbox, which names the libraries.
    """
    allowed = recording.environment.get("libraries")
    found = _MISSING.match(message)
    if not allowed or found is None:
        return None
    own = {package.name for package in recording.submission.packages}
    if nearest(found[1], own | PACKAGES, cutoff=0.8) is not None:
        return None
    return (
        f"Is {code(found[1])} spelt right? The machine that grades has Python's standard library, "
        f"ROS 2 and {codes(allowed.split())}. For another library, ask your instructor to allow "
        "it. If it is your own package or module: hand it in, name it in package.xml, let setup.py "
        "install it (packages=[...]), and import it from its package (from my_package import "
        "my_module)."
    )
