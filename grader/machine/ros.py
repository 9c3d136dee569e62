"""The ROS 2 installation that builds and runs students' packages.

Either ROS 2 Jazzy is sourced in the shell, or it is the wheels beside this interpreter;
which one is a pure function of the environment (:func:`find`).
"""

from __future__ import annotations

import os
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from grader.errors import GraderFault

DISTRO = "jazzy"
_WHEELS = "ros_*.libs"
_INDEX = "share/ament_index/resource_index/packages"
_APT = f"sudo apt install ros-{DISTRO}-rclpy ros-{DISTRO}-common-interfaces"

_KEPT = ("LANG", "LC_ALL", "LC_CTYPE", "TZ", "XDG_RUNTIME_DIR", "TMPDIR", "HOME", "USER")


@dataclass(frozen=True)
class RosInstallation:
    """Where ROS is, and the environment in which a child process finds it.

    Attributes:
        source: ``wheels`` or ``sourced``.
        inherited: Variables that a sourced installation needs, taken from the environment.
        left_out: Workspaces that are sourced as well. They may hold anything, also solutions, so
            nothing is built or run with them.
        underlays: Install spaces (merged layout) with the packages that it lacks; see
            :mod:`grader.submission.underlay`.
    """

    source: str
    python: Path
    prefixes: tuple[Path, ...]
    inherited: tuple[tuple[str, str], ...] = ()
    distro: str = DISTRO
    underlays: tuple[Path, ...] = ()
    left_out: tuple[Path, ...] = ()

    @property
    def notice(self) -> str:
        """What to say of sourced workspaces, or nothing if there are none."""
        if not self.left_out:
            return ""
        return (
            f"left out: {', '.join(map(str, self.left_out))} (sourced, but no part of ROS). If "
            "submissions need it, name its folder src under `underlays` in assignment.yaml"
        )

    @cached_property
    def packages(self) -> frozenset[str]:
        """Names of all packages in the ament index."""
        names: set[str] = set()
        for prefix in (*self.underlays, *self.prefixes):
            index = prefix / _INDEX
            if index.is_dir():
                names.update(entry.name for entry in index.iterdir())
        return frozenset(names)

    @cached_property
    def python_modules(self) -> frozenset[str]:
        """Names of the packages in the ament index that can be imported in Python."""
        roots = [
            Path(path) for path in dict(self.inherited).get("PYTHONPATH", "").split(":") if path
        ]
        roots += self.site_packages
        return frozenset(
            name for name in self.packages if any((root / name).is_dir() for root in roots)
        )

    @property
    def site_packages(self) -> list[Path]:
        """Folders that Python imports from."""
        return [path for one in (*self.underlays, *self.prefixes) for path in site_packages(one)]

    @property
    def preloaded(self) -> str:
        """What compiled programs are started with, such as a path, or nothing.

        The wheels' librcl needs libraries with symbols that only an interpreter defines.
        """
        return str(_libpython()) if self.source == "wheels" else ""

    def environment(
        self, environ: Mapping[str, str], overlays: tuple[Path, ...] = ()
    ) -> dict[str, str]:
        """Variables for a child process that uses this ROS, and nothing else of the caller's.

        Args:
            overlays: Install spaces (merged layout) in front of ROS, as after sourcing
                their ``local_setup.bash``.
        """
        overlays = (*overlays, *self.underlays)
        all_prefixes = (*overlays, *self.prefixes)
        prefixes = os.pathsep.join(map(str, all_prefixes))
        # The command `ros2` and what other packages install for a shell.
        programs = dict.fromkeys([self.python.parent, *(path / "bin" for path in all_prefixes)])
        result = {name: environ[name] for name in _KEPT if name in environ} | {
            **dict(self.inherited),
            "PATH": os.pathsep.join([*map(str, programs), "/usr/local/bin:/usr/bin:/bin"]),
            "ROS_DISTRO": self.distro,
            "ROS_VERSION": "2",
            "ROS_PYTHON_VERSION": "3",
            "AMENT_PREFIX_PATH": prefixes,
            "CMAKE_PREFIX_PATH": prefixes,
            "PYTHONNOUSERSITE": "1",
        }
        ahead = {
            "PYTHONPATH": [path for overlay in overlays for path in site_packages(overlay)],
            "LD_LIBRARY_PATH": [overlay / "lib" for overlay in overlays],
        }
        if self.source == "wheels":
            libraries = [path for one in self.site_packages for path in sorted(one.glob(_WHEELS))]
            ahead["LD_LIBRARY_PATH"] += [*(prefix / "lib" for prefix in self.prefixes), *libraries]
            # The wheels' start-up hook would set LD_LIBRARY_PATH and execute Python again.
            result["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] = "1"
            if "rclcpp" in self.packages:
                result["LD_PRELOAD"] = self.preloaded
        for name, paths in ahead.items():
            parts = [*map(str, paths), *filter(None, result.get(name, "").split(os.pathsep))]
            if parts:
                result[name] = os.pathsep.join(parts)
        return result


def site_packages(prefix: Path) -> list[Path]:
    """Folders of an install space that Python imports from."""
    return sorted(prefix.glob("lib/python3*/site-packages"))


def _libpython() -> Path:
    """The shared library of this Python."""
    known = {name: str(value or "") for name, value in sysconfig.get_config_vars().items()}
    name, folder = known["INSTSONAME"], Path(known["LIBDIR"])
    for file in (folder / name, folder / known.get("MULTIARCH", "") / name):
        if ".so" in name and file.is_file():
            return file
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    raise GraderFault(
        f"nodes in C++ need the shared library of Python, which is not here ({name}): sudo apt "
        f"install libpython{version}"
    )


def is_sourced(environ: Mapping[str, str]) -> bool:
    """Whether a ROS 2 installation is sourced in this environment."""
    return bool(environ.get("ROS_DISTRO") and environ.get("AMENT_PREFIX_PATH"))


def find(
    environ: Mapping[str, str] = os.environ,
    prefix: Path = Path(sys.prefix),
    executable: Path = Path(sys.executable),
) -> RosInstallation:
    """Choose the ROS installation: a sourced Jazzy wins over the wheels.

    Raises:
        GraderFault: Another distribution is sourced, or there is none at all.
    """
    if is_sourced(environ):
        return _sourced(environ, executable)
    if (prefix / _INDEX / "rclpy").exists():
        return RosInstallation(source="wheels", python=executable, prefixes=(prefix,))
    raise GraderFault(
        "no ROS 2 found: source /opt/ros/jazzy/setup.bash, or install the wheels with "
        "pip install 'rosgrade[ros]' (make setup does it)"
    )


def _sourced(environ: Mapping[str, str], python: Path) -> RosInstallation:
    distro = environ["ROS_DISTRO"]
    if distro != DISTRO:
        raise GraderFault(
            f"ROS 2 {distro} is sourced, but rosgrade grades with {DISTRO}: open a shell "
            f"without it, or source /opt/ros/{DISTRO}/setup.bash"
        )
    sourced = [Path(path) for path in environ["AMENT_PREFIX_PATH"].split(os.pathsep) if path]
    prefixes = _distribution(sourced)
    if not prefixes:
        raise GraderFault(f"ROS 2 {distro} is sourced, but has no rclpy: {_APT}")
    names = ("PYTHONPATH", "LD_LIBRARY_PATH")
    inherited = ((name, _below(prefixes, environ.get(name, ""))) for name in names)
    others = (path for path in sourced if path not in prefixes)
    return RosInstallation(
        source="sourced",
        python=python,
        prefixes=prefixes,
        inherited=tuple((name, paths) for name, paths in inherited if paths),
        left_out=tuple(dict.fromkeys(map(_install_space, others))),
    )


def _distribution(sourced: Sequence[Path]) -> tuple[Path, ...]:
    """The prefixes of ROS itself: the lowest one with rclpy, or all of an isolated build of it."""
    with_rclpy = [path for path in sourced if (path / _INDEX / "rclpy").exists()]
    if with_rclpy and _install_space(with_rclpy[-1]) != with_rclpy[-1]:
        return tuple(path for path in sourced if path.parent == with_rclpy[-1].parent)
    return tuple(with_rclpy[-1:])


def _install_space(prefix: Path) -> Path:
    """The folder that colcon installed to: by default each package has a prefix in it."""
    return prefix.parent if (prefix / _INDEX / prefix.name).exists() else prefix


def _below(prefixes: Sequence[Path], paths: str) -> str:
    parts = (part for part in paths.split(os.pathsep) if part)
    return os.pathsep.join(
        part for part in parts if any(Path(part).is_relative_to(prefix) for prefix in prefixes)
    )
