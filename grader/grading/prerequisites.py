"""What this machine has of all that grading needs, and how to get the rest."""

from __future__ import annotations

import os
import platform
import shutil
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata

from grader.errors import GraderFault
from grader.machine import ros
from grader.machine.load import cpu_count
from grader.spec.unit import format_duration
from grader.submission.build.toolchain import has_headers, headers_package, missing_tools


@dataclass(frozen=True)
class Part:
    """One thing that grading needs or profits from."""

    name: str
    present: bool
    found: str = ""
    remedy: str = ""
    required: bool = False


def diagnose() -> Iterator[Part]:
    """Look at every part; the slow ones (discovery) last."""
    yield Part("Python", True, f"{platform.python_version()} on {platform.platform()}")
    installation = None
    try:
        installation = ros.find()
    except GraderFault as fault:
        yield Part("ROS 2", False, remedy=str(fault), required=True)
    else:
        where = "wheels in " if installation.source == "wheels" else "sourced from "
        where += ", ".join(map(str, installation.prefixes))
        if installation.notice:
            where += f"; {installation.notice}"
        yield Part("ROS 2", True, f"{installation.distro}, {where}", required=True)
        yield _rmw(installation)
    yield _colcon()
    yield _program("C++ compiler", "g++", "for packages with own interfaces")
    yield _program("cmake", "cmake", "for ament_cmake packages")
    remedy = f"sudo apt install {headers_package()} (for packages with own interfaces)"
    yield Part("Python headers", has_headers(), sysconfig.get_path("include"), remedy)
    yield _sandbox()
    if installation is not None:
        yield from _underlays(installation)
    yield Part("load", True, f"{os.getloadavg()[0]:.2f} on {cpu_count()} CPUs (1 min average)")
    if installation is not None:
        yield _discovery(installation)


def _rmw(installation: ros.RosInstallation) -> Part:
    name = "rmw_fastrtps_cpp"
    remedy = f"install {name}: sudo apt install ros-jazzy-rmw-fastrtps-cpp"
    return Part("rmw", name in installation.packages, name, remedy, required=True)


def _colcon() -> Part:
    try:
        versions = [f"{name} {metadata.version(name)}" for name in ("colcon-core", "colcon-ros")]
    except metadata.PackageNotFoundError as error:
        return Part("colcon", False, remedy=f"pip install {error.name}", required=True)
    return Part("colcon", True, ", ".join(versions), required=True)


def _program(name: str, command: str, purpose: str) -> Part:
    path = shutil.which(command)
    return Part(name, path is not None, str(path), f"sudo apt install {command} ({purpose})")


def _sandbox() -> Part:
    from grader.sandbox.sandbox import LAYERS
    from grader.sandbox.trial import try_sandbox

    trial = try_sandbox()
    found = f"bubblewrap works ({', '.join(LAYERS)})"
    return Part("sandbox", not trial.problem, found, f"{trial.problem}; {trial.remedy}")


def _underlays(installation: ros.RosInstallation) -> Iterator[Part]:
    from grader.machine.resources import cache_folder
    from grader.submission.underlay.definition import SETS, packages_of_ros
    from grader.submission.underlay.ros2_command import REMEDY, find_command
    from grader.submission.underlay.store import UnderlayStore

    store = UnderlayStore(cache_folder(), installation)
    missing = {name for name in SETS if store.missing([packages_of_ros(name)])}
    built = [*sorted(SETS.keys() - missing)]
    built += [underlay.name for underlay, _ in store.installed() if underlay.name not in SETS]
    remedy = "what an assignment may need besides; `rosgrade underlay add NAME`"
    absent = f"; not here: {', '.join(sorted(missing))} ({remedy})" if missing else ""
    yield Part("underlays", True, f"{', '.join(built) or 'none'}{absent}")
    remedy = remedy_for_cpp(installation)
    yield Part("nodes in C++", not remedy, "can be graded", remedy)
    command = find_command(installation)
    yield Part("ros2", command is not None, str(command), REMEDY)


def remedy_for_cpp(installation: ros.RosInstallation) -> str:
    """What to do before nodes in C++ can be built and run here, or nothing."""
    from grader.machine.resources import cache_folder
    from grader.submission.underlay.definition import find_underlay
    from grader.submission.underlay.store import UnderlayStore

    packages = missing_tools(installation.environment({})["PATH"])
    try:
        _ = installation.preloaded
    except GraderFault:
        packages.append(headers_package())
    commands = [f"sudo apt install {' '.join(packages)}"] if packages else []
    if UnderlayStore(cache_folder(), installation).missing([find_underlay("rclcpp")]):
        commands.append("rosgrade underlay add rclcpp (once, some minutes)")
    return "; then ".join(commands)


def _discovery(installation: ros.RosInstallation) -> Part:
    from grader.run.cell.discovery_probe import discovery_time_s

    try:
        found = f"two nodes met after {format_duration(discovery_time_s(installation))}"
    except GraderFault as error:
        remedy = (
            f"two nodes on this machine do not meet: {error}. Is a firewall closing UDP on the "
            "loopback interface?"
        )
        return Part("discovery", False, remedy=remedy, required=True)
    return Part("discovery", True, found, required=True)
