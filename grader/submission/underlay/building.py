"""Builds the packages of a folder for an underlay, and names a build by all that it depends on."""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from grader.errors import GraderFault, SubmissionError, UsageError
from grader.machine.ros import RosInstallation
from grader.recording.submission import BuildRecord
from grader.sandbox.limits import BUILD
from grader.submission.build.build import Builder, once_more
from grader.submission.build.build_cache import BuildCache, CachedBuild
from grader.submission.build.build_error_location import Sources
from grader.submission.build.colcon import BuildLimits, BuildSetting
from grader.submission.build.toolchain import check_toolchain
from grader.submission.intake.listing import find_packages
from grader.submission.intake.locate import opened
from grader.submission.read.manifest import MANIFEST, read_manifest

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

INDEX = "share/ament_index/resource_index/packages"
# Raise it when the same sources would now be built differently, as by another wheels.cmake.
_RECIPE = 1
# Thirty interfaces take 95 s of CPU, and rclcpp more.
_LIMITS = BuildLimits(
    python_s=1800.0, other_s=1800.0, room=replace(BUILD, cpu_s=3600, memory_bytes=4 * 2**30)
)


@dataclass(frozen=True)
class Building:
    """How underlays are built.

    Attributes:
        sandbox: In which they are, or None.
        stop: Set when nothing needs to be built any more.
        name: Of what the packages are of, for messages.
    """

    say: Callable[[str], None]
    sandbox: Sandbox | None = None
    stop: threading.Event | None = None
    name: str = ""

    def build(
        self,
        folder: Path,
        ros: RosInstallation,
        cache: BuildCache,
        key: str,
        names: Collection[str] | None = None,
    ) -> Path:
        """Build the packages in a folder, unless they are in the cache; their install space.

        Args:
            names: Build these packages only.

        Raises:
            GraderFault: One could not be built.
            UsageError: There is none.
        """

        def attempt(is_second: bool) -> CachedBuild:
            with opened(folder) as located:
                places = {
                    package: place.relative_to(located.root).as_posix()
                    for package, place in packages_in(located.root).items()
                    if names is None or package in names
                }
                if not places:
                    raise UsageError(f"{folder}: there is no package in it (no {MANIFEST})")
                cmake_files = (located.root / place / "CMakeLists.txt" for place in places.values())
                only_python = not any(file.exists() for file in cmake_files)
                if not only_python:
                    check_toolchain(ros.environment({})["PATH"])
                setting = BuildSetting(
                    ros=ros,
                    limits=_LIMITS,
                    sandbox=self.sandbox,
                    stop=self.stop,
                    on_progress=self._counting(len(places)),
                )
                return Builder(setting, cache, is_second).build(
                    located,
                    Sources({file.path for file in located.files}, places),
                    only_python=only_python,
                    is_standalone=True,
                    key=key,
                )

        built = once_more(attempt)
        if built.install is not None and built.build.succeeded:
            return built.install
        # What it lacked may be there the next time.
        cache.discard(key)
        raise self._fault(built.build, folder)

    def _counting(self, total: int) -> Callable[[str], None]:
        """Says how far a build of so many packages is."""
        numbers = iter(range(1, total + 1))

        def say(what: str) -> None:
            if what.startswith("building "):
                what += f" ({next(numbers, '')} of {total}, once on this machine)"
            self.say(what)

        return say

    def _fault(self, record: BuildRecord, folder: Path) -> GraderFault:
        what = ", ".join(record.failed_packages) or folder.name
        if self.name:
            what += f" of {self.name}"
        lacks = f" (not installed here: {', '.join(record.lacking)})" if record.lacking else ""
        return GraderFault(
            f"{what} could not be built{lacks}: {record.culprit or record.log[-2000:]}"
        )


def digest(ros: RosInstallation, *parts: object) -> str:
    """The name of a build: of its sources, the ROS installation, and how it is built."""
    index = [prefix / INDEX for prefix in ros.prefixes if ros.source == "sourced"]
    installation = [
        ros.source,
        ros.distro,
        str(ros.python),
        [str(prefix) for prefix in ros.prefixes],
        *versions(ros),
        [folder.stat().st_mtime_ns for folder in index if folder.is_dir()],
    ]
    whole = [_RECIPE, installation, *parts]
    return hashlib.sha256(json.dumps(whole).encode()).hexdigest()


def versions(ros: RosInstallation) -> tuple[list[str], list[str]]:
    """The wheels of a ROS installation without its underlays, and the Python that they are for."""
    sites = replace(ros, underlays=()).site_packages
    wheels = sorted(wheel.name for site in sites for wheel in site.glob("ros_*.dist-info"))
    return wheels, sorted({site.parent.name for site in sites})


def folder_key(folder: Path, ros: RosInstallation, names: Collection[str] | None = None) -> str:
    """The name of the build of some packages of a folder, on ROS and its underlays."""
    left_out = sorted(packages_in(folder).keys() - names) if names is not None else []
    try:
        with opened(folder) as located:
            below = [path.parent.name for path in ros.underlays]
            return digest(ros, located.sha256, below, left_out)
    except SubmissionError as error:
        raise UsageError(f"{folder}: {error}") from error


def packages_in(folder: Path) -> dict[str, Path]:
    """The packages below a folder: name -> place."""
    packages: dict[str, Path] = {}
    paths = (path.relative_to(folder).as_posix() for path in folder.rglob("*"))
    for place in find_packages(paths):
        manifest = folder / place / MANIFEST
        name = read_manifest(manifest.read_bytes(), MANIFEST, {}).name or manifest.parent.name
        if name in packages:
            raise UsageError(
                f"{folder}: two packages are called {name!r}: {packages[name]}, {place}"
            )
        packages[name] = folder / place
    return packages


def indexed(prefix: Path) -> set[str]:
    """Names of the packages of an install space."""
    index = prefix / INDEX
    return {entry.name for entry in index.iterdir()} if index.is_dir() else set()
