"""The underlays that are built on this machine for one ROS installation.

``underlays/`` in the cache holds what was asked for by ``rosgrade underlay add``, until it is
removed: the sources of repositories in ``sources/``, install spaces in ``builds/``, each with an
``underlay.json``. What an assignment brings along is built from its folder when it is needed, and
kept with the builds of submissions.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import threading
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter, ValidationError

from grader.errors import GraderFault, SubmissionError, UsageError
from grader.machine.resources import BUILDS, INSTALL, UNDERLAYS, carried_interfaces
from grader.machine.ros import RosInstallation
from grader.machine.scratch import Scratch
from grader.sandbox.limits import BUILD
from grader.sandbox.python_tree import not_installed
from grader.submission.build.build import Builder, once_more
from grader.submission.build.build_cache import BuildCache, CachedBuild
from grader.submission.build.build_error_location import Sources
from grader.submission.build.colcon import BuildLimits, BuildSetting
from grader.submission.build.toolchain import check_toolchain, missing_tools
from grader.submission.intake.listing import find_packages
from grader.submission.intake.locate import opened
from grader.submission.read.manifest import MANIFEST, read_manifest
from grader.submission.underlay.definition import Underlay, find_underlay, sets_with
from grader.submission.underlay.fetch import fetch

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

CARRIED = carried_interfaces()
"""One folder for each package that the wheels lack and that is carried along."""

# Raise it when the same sources would now be built differently, as by another wheels.cmake.
_RECIPE = 1
_NOTE = "underlay.json"
_INDEX = "share/ament_index/resource_index/packages"
# Thirty interfaces take 95 s of CPU, and rclcpp more.
_LIMITS = BuildLimits(
    python_s=1800.0, other_s=1800.0, room=replace(BUILD, cpu_s=3600, memory_bytes=4 * 2**30)
)


@dataclass(frozen=True)
class Installed:
    """An underlay that was built, as ``underlay.json`` keeps it.

    Attributes:
        ros: The prefix of the ROS installation that it was built on.
        places: Where it is defined; older notes have none.
    """

    name: str
    ros: str
    packages: tuple[str, ...]
    places: tuple[str, ...] = ()


_INSTALLED = TypeAdapter(Installed)


class MissingUnderlay(GraderFault):
    """An underlay is not built on this machine."""

    def __init__(self, underlay: Underlay) -> None:
        """Name it, and the command that builds it."""
        super().__init__(
            f"the underlay {underlay.name!r} is not built here for this ROS installation; "
            f"to get it: rosgrade underlay add {underlay.given}"
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
        self._kept = BuildCache(self._folder, is_pruned=False)
        self._passing = BuildCache(cache)
        self._ros = ros
        self._say = on_progress
        self._sandbox = sandbox
        self._stop = stop

    def lay(self, underlays: Iterable[Underlay]) -> RosInstallation:
        """The ROS installation with underlays; a later one is seen before those named earlier.

        Raises:
            MissingUnderlay: One of those that have to be fetched is not built.
            UsageError: Two of them have the same package.
        """
        ros = self._ros
        for one in underlays:
            at = one.folder
            ros = on_top(ros, [self.folder_prefix(at, ros)] if at else self._prefixes(one))
        return ros

    def fetched(self, underlays: Iterable[Underlay]) -> list[Path]:
        """Install spaces of those underlays that have to be fetched; quick, builds nothing.

        Raises:
            MissingUnderlay: One is not built.
        """
        return [path for one in underlays if one.repos for path in self._prefixes(one)]

    def missing(self, underlays: Iterable[Underlay]) -> list[MissingUnderlay]:
        """Those that have to be fetched and are not there."""
        found = []
        for underlay in underlays:
            try:
                self.fetched([underlay])
            except MissingUnderlay as missing:
                found.append(missing)
        return found

    def add(self, underlay: Underlay, answer_s: float) -> list[str]:
        """Build an underlay and what it requires, unless they are there; names of what was built.

        Args:
            answer_s: Longest time until a git server answers.
        """
        done = [name for one in _required(underlay) for name in self.add(one, answer_s)]
        if not self._wanted(underlay):
            self._say(f"{underlay.name}: this ROS has its packages, nothing is built")
            return done
        for lack in not_installed(underlay.python, f"the underlay {underlay.name} needs"):
            raise GraderFault(lack)
        with Scratch("underlay") as staging:
            folder, ros = underlay.folder, self._ros
            if folder is None:
                key = self._key(underlay)
                if self._kept.find(key) and (self._entry(key) / _NOTE).is_file():
                    self._say(f"{underlay.name}: is there already")
                    self._note(underlay, key)
                    return done
                self._fetch(underlay, staging, answer_s)
                below = [path for one in _required(underlay) for path in self._prefixes(one)]
                folder, ros = staging, on_top(ros, below)
            else:
                key = self._folder_key(folder, ros)
            self._build(underlay.name, folder, ros, self._kept, key)
        self._note(underlay, key)
        return [*done, underlay.name]

    def folder_prefix(
        self, folder: Path, ros: RosInstallation, names: Collection[str] | None = None
    ) -> Path:
        """The install space of the packages of a folder, built on ROS and underlays if need be.

        Args:
            names: Build these packages only.
        """
        key = self._folder_key(folder, ros, names)
        if (self._entry(key) / _NOTE).is_file():
            return self._entry(key) / INSTALL
        return self._build(folder.name, folder, ros, self._passing, key, names)

    def needed(self, ros: RosInstallation, named: Collection[str]) -> RosInstallation:
        """Add to an installation the sets that are taken by need, where they are built."""
        for underlay in sets_with(frozenset(named) - ros.packages):
            if underlay.by_need:
                # Where it is not, the build says what it lacks, and the rest is graded.
                with suppress(MissingUnderlay):
                    ros = on_top(ros, self._prefixes(underlay))
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
        """Every kept underlay of this ROS installation with its install space, by name."""
        mine = str(self._ros.prefixes[0])
        return [(one, at / INSTALL) for one, at in self._entries() if one.ros == mine]

    def remove(self, name: str) -> bool:
        """Remove a kept underlay by its name or place, also for installations that are gone.

        Raises:
            UsageError: Underlays of several places have the name.
        """
        found = [(one, at) for one, at in self._own() if name in (one.name, *one.places)]
        places = sorted({one.places for one, _ in found if name not in one.places})
        if len(places) > 1:
            each = " or ".join(place for some in places for place in some[:1])
            raise UsageError(f"several underlays are called {name!r}: remove {each}")
        for _, folder in found:
            shutil.rmtree(folder)
        return bool(found)

    def _own(self) -> list[tuple[Installed, Path]]:
        """Kept underlays of this ROS installation, and of installations that are gone."""
        mine = str(self._ros.prefixes[0])
        return [
            (one, at)
            for one, at in self._entries()
            if one.ros == mine or not Path(one.ros).exists()
        ]

    def _note(self, underlay: Underlay, key: str) -> None:
        """Keep a build; what was built of the same place before is thrown away."""
        places, before = {underlay.place}, None
        for one, at in self._own():
            of = one.places or (one.name,)
            if at.name == key:
                places.update(one.places)
                before = one
            elif of == (underlay.place,):
                shutil.rmtree(at)
            elif underlay.place in of:
                _write_note(at, replace(one, places=tuple(set(of) - {underlay.place})))
        packages = sorted(_indexed(self._entry(key) / INSTALL))
        mine = str(self._ros.prefixes[0])
        note = Installed(underlay.name, mine, tuple(packages), tuple(sorted(places)))
        if note != before:
            _write_note(self._entry(key), note)

    def _entry(self, key: str) -> Path:
        return self._folder / BUILDS / key

    def _entries(self) -> list[tuple[Installed, Path]]:
        found = []
        for file in (self._folder / BUILDS).glob(f"*/{_NOTE}"):
            try:
                found.append((_INSTALLED.validate_json(file.read_bytes()), file.parent))
            except (OSError, ValidationError):
                continue
        return sorted(found, key=lambda entry: entry[0].name)

    def _prefixes(self, underlay: Underlay) -> list[Path]:
        """Install spaces of an underlay and of those that it requires; none if ROS has it all."""
        try:
            below = [path for one in _required(underlay) for path in self._prefixes(one)]
        except MissingUnderlay:
            # To add this one gets what it requires, too.
            raise MissingUnderlay(underlay) from None
        if not self._wanted(underlay):
            return below
        entry = self._entry(self._key(underlay))
        if not (entry / _NOTE).is_file():
            raise MissingUnderlay(underlay)
        return list(dict.fromkeys([*below, entry / INSTALL]))

    def _wanted(self, underlay: Underlay) -> frozenset[str]:
        """The packages that are built, where they are listed: those that ROS lacks."""
        return underlay.listed - self._ros.packages if underlay.listed else frozenset({"all"})

    def _key(self, underlay: Underlay) -> str:
        assert underlay.repos is not None
        required = [self._key(one) for one in _required(underlay) if self._wanted(one)]
        wanted = sorted(self._wanted(underlay))
        sources = underlay.repos.model_dump_json(exclude={"by_need"})
        return self._digest(sources, wanted, required)

    def _folder_key(
        self, folder: Path, ros: RosInstallation, names: Collection[str] | None = None
    ) -> str:
        left_out = sorted(packages_in(folder).keys() - names) if names is not None else []
        try:
            with opened(folder) as located:
                below = [path.parent.name for path in ros.underlays]
                return self._digest(located.sha256, below, left_out)
        except SubmissionError as error:
            raise UsageError(f"{folder}: {error}") from error

    def _digest(self, *parts: object) -> str:
        """The name of a build: of its sources, the ROS installation, and how it is built."""
        ros, sites = self._ros, self._ros.site_packages
        index = [prefix / _INDEX for prefix in ros.prefixes if ros.source == "sourced"]
        installation = [
            ros.source,
            ros.distro,
            str(ros.python),
            [str(prefix) for prefix in ros.prefixes],
            sorted(at.name for site in sites for at in site.glob("ros_*.dist-info")),
            sorted({site.parent.name for site in sites}),
            [at.stat().st_mtime_ns for at in index if at.is_dir()],
        ]
        whole = [_RECIPE, installation, *parts]
        return hashlib.sha256(json.dumps(whole).encode()).hexdigest()

    def _fetch(self, underlay: Underlay, staging: Path, answer_s: float) -> None:
        """Put the packages of all repositories side by side."""
        assert underlay.repos is not None
        places: dict[str, str] = {}
        for name, repository in underlay.repos.repositories.items():
            files = fetch(name, repository, self._folder, answer_s, self._say)
            there, version = packages_in(files), f"{name} {repository.version}"
            for package in repository.packages or sorted(there):
                if package not in there:
                    raise UsageError(f"{underlay.given}: {version} has no package {package!r}")
                other = places.setdefault(package, version)
                if other != version:
                    raise UsageError(
                        f"{underlay.given}: the package {package!r} is in {other} and in "
                        f"{version}: list in 'packages' of each repository which of its packages "
                        "to build"
                    )
                if package in self._wanted(underlay) or not underlay.listed:
                    shutil.copytree(there[package], staging / package, symlinks=True)

    def _build(
        self,
        name: str,
        folder: Path,
        ros: RosInstallation,
        cache: BuildCache,
        key: str,
        names: Collection[str] | None = None,
    ) -> Path:
        """Build the packages in a folder, unless they are in the cache; their install space."""

        def attempt(is_second: bool) -> CachedBuild:
            with opened(folder) as located:
                places = {
                    package: place.relative_to(located.root).as_posix()
                    for package, place in packages_in(located.root).items()
                    if names is None or package in names
                }
                if not places:
                    raise UsageError(f"{folder}: there is no package in it (no {MANIFEST})")
                begun = iter(range(1, len(places) + 1))

                def progress(what: str) -> None:
                    if what.startswith("building "):
                        what += f" ({next(begun, '')} of {len(places)}, once on this machine)"
                    self._say(f"{name}: {what}")

                roots = [located.root / place for place in places.values()]
                only_python = not any((root / "CMakeLists.txt").exists() for root in roots)
                if not only_python:
                    check_toolchain(ros.environment({})["PATH"])
                setting = BuildSetting(
                    ros=ros,
                    limits=_LIMITS,
                    sandbox=self._sandbox,
                    stop=self._stop,
                    on_progress=progress,
                )
                return Builder(setting, cache, is_second).build(
                    located,
                    Sources({file.path for file in located.files}, places),
                    only_python=only_python,
                    is_standalone=True,
                    key=key,
                )

        built = once_more(attempt)
        record = built.build
        if built.install is not None and record.succeeded:
            return built.install
        # What it lacked may be there the next time.
        cache.discard(key)
        lacks = f" (not installed here: {', '.join(record.lacking)})" if record.lacking else ""
        raise GraderFault(
            f"{', '.join(record.failed_packages) or name} of {name} could not be built{lacks}: "
            f"{record.culprit or record.log[-2000:]}"
        )


def on_top(ros: RosInstallation, prefixes: Sequence[Path]) -> RosInstallation:
    """A ROS installation with more install spaces; two must not have the same package."""
    for prefix in prefixes:
        if prefix in ros.underlays:
            continue
        taken = {name for other in ros.underlays for name in _indexed(other)}
        for package in sorted(_indexed(prefix) & taken):
            raise UsageError(
                f"the package {package!r} is in two underlays of the assignment: drop it in one"
            )
        ros = replace(ros, underlays=(prefix, *ros.underlays))
    return ros


def _write_note(folder: Path, note: Installed) -> None:
    (folder / _NOTE).write_bytes(_INSTALLED.dump_json(note, indent=1))


def packages_in(folder: Path) -> dict[str, Path]:
    """The packages below a folder: name -> place."""
    found: dict[str, Path] = {}
    for place in find_packages(at.relative_to(folder).as_posix() for at in folder.rglob("*")):
        manifest = folder / place / MANIFEST
        name = read_manifest(manifest.read_bytes(), MANIFEST, {}).name or manifest.parent.name
        if name in found:
            raise UsageError(f"{folder}: two packages are called {name!r}: {found[name]}, {place}")
        found[name] = folder / place
    return found


def _indexed(prefix: Path) -> set[str]:
    """Names of the packages of an install space."""
    index = prefix / _INDEX
    return {entry.name for entry in index.iterdir()} if index.is_dir() else set()


def _required(underlay: Underlay) -> list[Underlay]:
    return [find_underlay(name) for name in underlay.repos.requires] if underlay.repos else []
