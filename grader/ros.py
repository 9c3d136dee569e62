"""The ROS 2 installation that builds and runs students' packages.

Either ROS 2 Jazzy is sourced in the shell, or it is the wheels beside this interpreter;
which one is a pure function of the environment (:func:`find`).
"""

from __future__ import annotations

import os
import sys
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from grader.errors import GraderFault

DISTRO = "jazzy"
_WHEELS = "ros_*.libs"

_KEPT = ("LANG", "LC_ALL", "LC_CTYPE", "TZ", "XDG_RUNTIME_DIR", "TMPDIR", "HOME", "USER")


@dataclass(frozen=True)
class RosInstallation:
    """Where ROS is, and the environment in which a child process finds it.

    Attributes:
        source: ``wheels`` or ``sourced``.
        inherited: Variables that a sourced installation needs, taken from the environment.
        underlays: Install spaces (merged layout) with the packages that it lacks; see
            :mod:`grader.submission.underlay`.
    """

    source: str
    python: Path
    prefixes: tuple[Path, ...]
    inherited: tuple[tuple[str, str], ...] = ()
    distro: str = DISTRO
    underlays: tuple[Path, ...] = ()

    @cached_property
    def packages(self) -> frozenset[str]:
        """Names of all packages in the ament index."""
        found: set[str] = set()
        for prefix in (*self.underlays, *self.prefixes):
            index = prefix / "share/ament_index/resource_index/packages"
            if index.is_dir():
                found.update(entry.name for entry in index.iterdir())
        return frozenset(found)

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
        prefixes = os.pathsep.join(str(path) for path in (*overlays, *self.prefixes))
        result = {name: environ[name] for name in _KEPT if name in environ} | {
            **dict(self.inherited),
            "PATH": os.pathsep.join([str(self.python.parent), "/usr/local/bin:/usr/bin:/bin"]),
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
        distro = environ["ROS_DISTRO"]
        if distro != DISTRO:
            raise GraderFault(
                f"ROS 2 {distro} is sourced, but rosgrade grades with {DISTRO}: open a shell "
                f"without it, or source /opt/ros/{DISTRO}/setup.bash"
            )
        names = ("PYTHONPATH", "LD_LIBRARY_PATH")
        return RosInstallation(
            source="sourced",
            python=executable,
            prefixes=tuple(Path(p) for p in environ["AMENT_PREFIX_PATH"].split(os.pathsep) if p),
            inherited=tuple((name, environ[name]) for name in names if environ.get(name)),
        )
    if (prefix / "share/ament_index/resource_index/packages/rclpy").exists():
        return RosInstallation(source="wheels", python=executable, prefixes=(prefix,))
    raise GraderFault(
        "no ROS 2 found: source /opt/ros/jazzy/setup.bash, or install the wheels with "
        "pip install 'rosgrade[ros]' (make setup does it)"
    )
