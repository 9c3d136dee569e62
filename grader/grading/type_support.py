"""What lies under the submissions of an assignment: for the students, and for the probe."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Mapping
from pathlib import Path

from grader.assignment.interfaces import FOLDER, FOLDERS, write_interfaces
from grader.assignment.load import LoadedAssignment
from grader.errors import GraderFault
from grader.grading.own_interfaces import OWN, Definitions, write_packages
from grader.machine.resources import cache_folder
from grader.machine.ros import RosInstallation, find
from grader.machine.scratch import Scratch
from grader.submission.prepare import needed_packages
from grader.submission.underlay.building import packages_in
from grader.submission.underlay.definition import Underlay, find_underlay, packages_of_ros
from grader.submission.underlay.store import CARRIED, MissingUnderlay, UnderlayStore, on_top

_WORD = re.compile(r"\w+")
_INTERFACES = "share/ament_index/resource_index/rosidl_interfaces"

Say = Callable[[str], None]


def underlays_of(loaded: LoadedAssignment) -> list[Underlay]:
    """The underlays that an assignment names."""
    return [find_underlay(given, loaded.folder) for given in loaded.assignment.underlays]


def wanted_underlays(loaded: LoadedAssignment, submission: Path | None = None) -> list[Underlay]:
    """The underlays that it takes to grade a submission, or any submission if none is given."""
    named, ros = underlays_of(loaded), find()
    if submission is not None:
        used = needed_packages(submission, ros)
    else:
        packages = loaded.assignment.packages
        in_cpp = (package for package in packages if "ament_cmake" in package.build_types)
        used = {
            name
            for package in in_cpp
            for name in {*package.depends_in_cpp} - {*package.depends_in_python}
        }
    listed = {package for underlay in named for package in underlay.listed}
    carried = {folder.name for folder in CARRIED.iterdir()}
    more = map(packages_of_ros, sorted(used - ros.packages - listed - carried))
    return list({underlay.place: underlay for underlay in (*named, *more)}.values())


def missing_underlays(loaded: LoadedAssignment) -> list[str]:
    """What has to be built before an assignment can be graded here, and by which one command."""
    try:
        store = UnderlayStore(cache_folder(), find())
    except GraderFault:
        # Without any ROS another message tells what to install first.
        return []
    missing = store.missing(underlays_of(loaded))
    return [str(MissingUnderlay(*missing))] if missing else []


class TypeSupport:
    """The underlays of an assignment; nothing is built before they are asked for."""

    def __init__(
        self,
        loaded: LoadedAssignment,
        ros: RosInstallation,
        cache: Path,
        stop: threading.Event | None = None,
        own: Mapping[str, Definitions] = {},
    ) -> None:
        """Set up; nothing is built yet.

        Args:
            stop: Set when nothing needs to be built any more.
            own: Packages of interfaces of the student's own, which the probe has to read.

        Raises:
            MissingUnderlay: The assignment needs some that are not on this machine.
        """
        UnderlayStore(cache, ros).fetched(underlays_of(loaded))
        self._loaded = loaded
        self._ros = ros
        self._cache = cache
        self._stop = stop
        self._own = own
        self._lock = threading.Lock()
        self._found: dict[bool, RosInstallation] = {}

    def student(self, on_build: Say = lambda _: None) -> RosInstallation:
        """The ROS installation that submissions are built and run with."""
        return self._laid(for_probe=False, on_build=on_build)

    def prefixes(self, on_build: Say = lambda _: None) -> tuple[Path, ...]:
        """Install spaces that the probe imports interfaces from, to hear and send messages."""
        laid = self._laid(for_probe=True, on_build=on_build)
        return tuple(path for path in laid.underlays if (path / _INTERFACES).is_dir())

    def _laid(self, *, for_probe: bool, on_build: Say) -> RosInstallation:
        with self._lock:
            laid = self._found.get(for_probe)
            # The cache may be emptied while a class is graded, or rosgrade watches.
            if laid is None or not all(path.is_dir() for path in laid.underlays):
                laid = self._found[for_probe] = self._built(for_probe, on_build)
            return laid

    def _built(self, for_probe: bool, on_build: Say) -> RosInstallation:
        store = UnderlayStore(self._cache, self._ros, on_build, stop=self._stop)
        ros = store.lay(underlays_of(self._loaded))
        with Scratch(FOLDER) as copies:
            for name in FOLDERS:
                if (self._loaded.folder / name).is_dir():
                    ros = self._with_authors(name, store, ros, copies, for_probe=for_probe)
            if for_probe:
                ros = self._with_students(store, ros, copies / OWN)
        return store.completed(ros, self._named_words()) if for_probe else ros

    def _with_authors(
        self,
        name: str,
        store: UnderlayStore,
        ros: RosInstallation,
        copies: Path,
        *,
        for_probe: bool,
    ) -> RosInstallation:
        """ROS with the packages in one folder beside the assignment on top."""
        folder = self._loaded.folder / name
        if name == FOLDER and self._loaded.values:
            folder = copies / FOLDER
            write_interfaces(self._loaded.folder, self._loaded.values, folder)
        names = set(packages_in(folder))
        if not for_probe:
            # What students have to write is not given to them.
            names -= {package.name for package in self._loaded.assignment.packages}
        return on_top(ros, [store.folder_prefix(folder, ros, names)]) if names else ros

    def _with_students(
        self, store: UnderlayStore, ros: RosInstallation, folder: Path
    ) -> RosInstallation:
        """ROS with the interfaces of the student's own on top, which the probe has to read."""
        packages = {name: one for name, one in self._own.items() if name not in ros.packages}
        if not packages:
            return ros
        write_packages(packages, folder)
        return on_top(ros, [store.folder_prefix(folder, ros)])

    def _named_words(self) -> list[str]:
        """Every word in the assignment: some are packages of types that the probe hears."""
        assignment = self._loaded.assignment
        types = [type for one in assignment.scenarios for type in one.recorded_types.values()]
        words = _WORD.findall(" ".join([assignment.model_dump_json(), *types]))
        if any(scenario.turtles for scenario in assignment.scenarios):
            words.append("turtlesim")
        return words
