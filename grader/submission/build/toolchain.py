"""What a build takes from the system: the compiler, CMake, libraries, Python's headers."""

from __future__ import annotations

import shutil
import sys
import sysconfig
from collections.abc import Collection
from pathlib import Path

from grader.errors import GraderFault
from grader.machine.bootstrap import COMPILERS
from grader.machine.ros import DISTRO
from grader.submission.build.build_log import PYTHON_HEADERS
from grader.submission.read.rosdistro import PACKAGES

_HINT = "this machine cannot build packages that are not pure Python, because tools are missing:"
# What CMake calls the libraries that rosdep installs for the packages of ROS 2 Jazzy.
_LIBRARIES = """
ALSA assimp Armadillo Boost Bullet Ceres console_bridge CURL Eigen3 fmt FLANN GLEW glfw3 GLUT GTest
jsoncpp LAPACK nlohmann_json OpenCV OpenGL orocos_kdl OpenSSL PCL PkgConfig Poco Protobuf pybind11
Qt5 Qt6 SDL2 spdlog SQLite3 TBB TinyXML2 tinyxml2 urdfdom urdfdom_headers VTK yaml-cpp ZLIB
"""
_PLACES = ("lib/cmake/{}*", "lib/*/cmake/{}*", "share/cmake*/{}*", "share/{}*/cmake")
_FOLDERS = ("lib/cmake", "lib/*/cmake", "include")


def missing_tools(path: str) -> list[str]:
    """Packages of Debian and Ubuntu with what compiles and is not there."""
    return [package for tool, package in COMPILERS.items() if not shutil.which(tool, path=path)]


def check_toolchain(path: str) -> None:
    """See that what compiles is there.

    Raises:
        GraderFault: Something is not installed on this machine.
    """
    missing = missing_tools(path)
    if missing:
        raise GraderFault(f"{_HINT} sudo apt install {' '.join(missing)}")


def missing_here(names: Collection[str]) -> set[str]:
    """Those libraries that a build did not find because they are not installed."""
    missing = {name for name in set(_LIBRARIES.split()) & set(names) if not _has_library(name)}
    return missing if has_headers() else missing | {PYTHON_HEADERS} & set(names)


def watched_folders() -> list[Path]:
    """Folders that change when a library or its headers are installed."""
    found = [path for pattern in _FOLDERS for path in sorted(Path("/usr").glob(pattern))]
    return [*found, Path(sysconfig.get_path("include"))]


def _has_library(name: str) -> bool:
    return any(any(Path("/usr").glob(place.format(name))) for place in _PLACES)


def has_headers() -> bool:
    """Whether this machine has Python's headers."""
    return Path(sysconfig.get_path("include"), "Python.h").is_file()


def apt_package(name: str) -> str:
    """What Debian and Ubuntu call a tool, or a package of ROS; nothing where that is not known."""
    if name in PACKAGES:
        return f"ros-{DISTRO}-{name.replace('_', '-')}"
    return name if name in COMPILERS.values() or name == PYTHON_HEADERS else ""


def headers_package() -> str:
    """The package of Debian and Ubuntu that has them."""
    return f"python{sys.version_info.major}.{sys.version_info.minor}-dev"
