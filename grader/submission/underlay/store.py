"""The underlays that are built on this machine for one ROS installation.

``underlays/`` in the cache holds what was asked for by ``rosgrade underlay add``, until it is
removed: the sources of repositories in ``sources/``, install spaces in ``builds/``, each with an
``underlay.json``. A package of ROS 2 has an install space of its own, so that it is built once for
all that need it. What an assignment brings along is built from its folder when it is needed, and
kept with the builds of submissions.
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from grader.errors import GraderFault, UsageError
from grader.machine.resources import UNDERLAYS, carried_interfaces
from grader.machine.ros import RosInstallation
from grader.machine.scratch import Scratch
from grader.sandbox.python_tree import not_installed
from grader.submission.build.build_cache import BuildCache
from grader.submission.build.toolchain import missing_tools
from grader.submission.underlay.building import (
    Building,
    digest,
    folder_key,
    indexed,
    packages_in,
)
from grader.submission.underlay.definition import Underlay, providers
from grader.submission.underlay.fetch import fetch
from grader.submission.underlay.kept import Installed, Kept
from grader.submission.underlay.packages import Packages

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

CARRIED = carried_interfaces()
"""One folder for each package that the wheels lack and that is carried along."""


class MissingUnderlay(GraderFault):
    """Underlays are not built on this machine."""

    def __init__(self, *underlays: Underlay) -> None:
        """Name them, and the one command that builds them."""
        names = ", ".join(repr(one.name) for one in underlays)
        is_one = len(underlays) == 1
        super().__init__(
            f"the underlay{'' if is_one else 's'} {names} {'is' if is_one else 'are'} not built "
            f"here for this ROS installation; to get {'it' if is_one else 'them'}: "
            f"rosgrade underlay add {' '.join(one.given for one in underlays)}"
        )


class UnderlayStore:
    """What is built for one ROS installation, and builds what is not."""

    def __init__(
        self,
        cache: Path,
        ros: RosInstallation,
        on_progress: Callable[[str], None] = lambda _: None,
        sandbox: Sandbox | None = None,
        stop: threading.Event | None = None,
    ) -> None:
        """Name the cache folder.

        Args:
            ros: Without underlays.
            sandbox: In which packages are built.
            stop: Set when nothing needs to be built any more.
        """
        self._folder = cache / UNDERLAYS
        self._passing = BuildCache(cache)
        self._ros = ros
        self._say = on_progress
        self._building = Building(on_progress, sandbox, stop)
        self.kept = Kept(self._folder, ros)
        self.packages = Packages(self._folder, ros, self.kept, self._building)

    def lay(self, underlays: Iterable[Underlay]) -> RosInstallation:
        """The ROS installation with underlays; a later one is seen before those named earlier.

        Raises:
            MissingUnderlay: One of those that have to be added is not built.
            UsageError: Two of them have the same package.
        """
        ros = self._ros
        for underlay in underlays:
            if underlay.packages:
                ros = _below(ros, self._chain(underlay, underlay))
            for required in underlay.required:
                ros = _below(ros, self._chain(required, underlay))
            if underlay.folder:
                ros = on_top(ros, [self.folder_prefix(underlay.folder, ros)])
            elif underlay.repos:
                ros = on_top(ros, self._own_prefix(underlay))
        return ros

    def fetched(self, underlays: Iterable[Underlay]) -> list[Path]:
        """Install spaces of those underlays that have to be added; quick, builds nothing.

        Raises:
            MissingUnderlay: Some are not built.
        """
        added = [one for one in underlays if not one.folder]
        if missing := self.missing(added):
            raise MissingUnderlay(*missing)
        return list(self.lay(added).underlays)

    def missing(self, underlays: Iterable[Underlay]) -> list[Underlay]:
        """Those that have to be added and are not there."""
        missing = []
        for underlay in (one for one in underlays if not one.folder):
            try:
                self.lay([underlay])
            except MissingUnderlay:
                missing.append(underlay)
        return missing

    def add(self, underlays: Sequence[Underlay], answer_s: float) -> list[str]:
        """Build underlays and what they need, unless it is there; names of what was built.

        What was built stays if a later one fails.

        Args:
            answer_s: Longest time until a git server answers.
        """
        of_ros = {one.place: one for one in underlays if one.packages}
        for underlay in underlays:
            of_ros.update((one.place, one) for one in underlay.required)
        built = self.packages.add(list(of_ros.values()), answer_s)
        for underlay in underlays:
            if not underlay.packages:
                built += self._add_own(underlay, answer_s)
        return built

    def folder_prefix(
        self, folder: Path, ros: RosInstallation, names: Collection[str] | None = None
    ) -> Path:
        """The install space of the packages of a folder, built on ROS and underlays if need be.

        Args:
            names: Build these packages only.
        """
        key = folder_key(folder, ros, names)
        kept = self.kept.find(key)
        if kept is not None:
            return kept
        return self._named(folder.name).build(folder, ros, self._passing, key, names)

    def needed(self, ros: RosInstallation, named: Collection[str]) -> RosInstallation:
        """Add to an installation the packages of ROS 2 that are named, where they are built."""
        for name in sorted(providers(named) & self.packages.built().keys() - ros.packages):
            # Where one is not whole, the build says what it lacks, and the rest is graded.
            ros = _below(ros, self.packages.chain([name]) or [])
        return ros

    def completed(self, ros: RosInstallation, named: Iterable[str]) -> RosInstallation:
        """Add to an installation what it lacks of the packages that are carried along."""
        if missing_tools(ros.environment({})["PATH"]):
            # What needs them will say so, and the rest of the submission is graded.
            return ros
        lacking = [name for name in sorted(set(named) - ros.packages) if (CARRIED / name).is_dir()]
        # Each for itself: it is the same build, whatever else is under the submission.
        prefixes = [self.folder_prefix(CARRIED / name, self._ros) for name in lacking]
        return replace(ros, underlays=(*ros.underlays, *prefixes)) if prefixes else ros

    def installed(self) -> list[tuple[Installed, Path]]:
        """Everything that is built for this ROS installation, with its install space, by name."""
        own = [(note, install) for note, install in self.kept.installed() if not note.snapshot]
        return sorted([*own, *self.packages.built().values()], key=lambda entry: entry[0].name)

    def _add_own(self, underlay: Underlay, answer_s: float) -> list[str]:
        """Build a list or a folder of a course, unless it is there."""
        if not self._lacking(underlay):
            self._say(f"{underlay.name}: this ROS has its packages, nothing is built")
            return []
        python = underlay.repos.python if underlay.repos else ()
        for lack in not_installed(python, f"the underlay {underlay.name} needs"):
            raise GraderFault(lack)
        with Scratch("underlay") as staging:
            folder, ros, key = underlay.folder, self._ros, self._key(underlay)
            if folder is None and self.kept.has(key):
                self._say(f"{underlay.name}: is there already")
            else:
                if folder is None:
                    self._fetch(underlay, staging, answer_s)
                    folder, ros = staging, self._on_required(underlay)
                self._named(underlay.name).build(folder, ros, self.kept.cache, key)
        packages = tuple(sorted(indexed(self.kept.install(key))))
        note = Installed(underlay.name, str(ros.prefixes[0]), packages, (underlay.place,))
        is_new = self.kept.find(key) is None
        self.kept.note(key, note)
        self.kept.settle(underlay.place, [key])
        return [underlay.name] if is_new else []

    def _named(self, name: str) -> Building:
        """Building with a name before each line of its progress."""
        return replace(self._building, name=name, say=lambda what: self._say(f"{name}: {what}"))

    def _chain(self, underlay: Underlay, asking: Underlay) -> list[Path]:
        """Install spaces of packages of ROS 2, and of what they need."""
        installs = self.packages.chain(underlay.packages)
        if installs is None:
            # To add what requires it adds it, too.
            raise MissingUnderlay(asking)
        return installs

    def _on_required(self, underlay: Underlay) -> RosInstallation:
        below = [path for one in underlay.required for path in self._chain(one, underlay)]
        return _below(self._ros, below)

    def _own_prefix(self, underlay: Underlay) -> list[Path]:
        """The install space of a list of repositories; none if ROS has it all."""
        if not self._lacking(underlay):
            return []
        install = self.kept.find(self._key(underlay))
        if install is None:
            raise MissingUnderlay(underlay)
        return [install]

    def _lacking(self, underlay: Underlay) -> frozenset[str]:
        """The packages that are built: those that ROS lacks, or ``all`` where none are listed."""
        return underlay.listed - self._ros.packages if underlay.listed else frozenset({"all"})

    def _key(self, underlay: Underlay) -> str:
        if underlay.folder is not None:
            return folder_key(underlay.folder, self._ros)
        assert underlay.repos is not None
        below = [path.parent.name for path in self._on_required(underlay).underlays]
        lacking = sorted(self._lacking(underlay))
        return digest(self._ros, underlay.repos.model_dump_json(), lacking, below)

    def _fetch(self, underlay: Underlay, staging: Path, answer_s: float) -> None:
        """Put the packages of all repositories side by side."""
        assert underlay.repos is not None
        places: dict[str, str] = {}
        for name, repository in underlay.repos.repositories.items():
            files = fetch(name, repository, self._folder, answer_s, self._say)
            folders, version = packages_in(files), f"{name} {repository.version}"
            for package in repository.packages or sorted(folders):
                if package not in folders:
                    raise UsageError(f"{underlay.given}: {version} has no package {package!r}")
                other = places.setdefault(package, version)
                if other != version:
                    raise UsageError(
                        f"{underlay.given}: the package {package!r} is in {other} and in "
                        f"{version}: list in 'packages' of each repository which of its packages "
                        "to build"
                    )
                if package in self._lacking(underlay) or not underlay.listed:
                    shutil.copytree(folders[package], staging / package, symlinks=True)


def on_top(ros: RosInstallation, prefixes: Sequence[Path]) -> RosInstallation:
    """A ROS installation with more install spaces; two must not have the same package."""
    for prefix in prefixes:
        if prefix in ros.underlays:
            continue
        taken = {name for other in ros.underlays for name in indexed(other)}
        for package in sorted(indexed(prefix) & taken):
            raise UsageError(
                f"the package {package!r} is in two underlays of the assignment: drop it in one"
            )
        ros = replace(ros, underlays=(prefix, *ros.underlays))
    return ros


def _below(ros: RosInstallation, prefixes: Sequence[Path]) -> RosInstallation:
    """A ROS installation with more install spaces, for what the others have not."""
    for prefix in prefixes:
        if prefix not in ros.underlays and not indexed(prefix) & ros.packages:
            ros = replace(ros, underlays=(*ros.underlays, prefix))
    return ros
