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
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter, ValidationError

from grader.errors import GraderFault, SubmissionError, UsageError
from grader.resources import carried_interfaces
from grader.ros import RosInstallation
from grader.sandbox.limits import BUILD
from grader.sandbox.python_tree import not_installed
from grader.scratch import Scratch
from grader.submission.build.build import Builder, once_more
from grader.submission.build.build_cache import BUILDS, BuildCache, CachedBuild
from grader.submission.build.build_error_location import Sources
from grader.submission.build.colcon import BuildLimits
from grader.submission.build.toolchain import check_toolchain, missing_tools
from grader.submission.intake.listing import find_packages
from grader.submission.intake.locate import Located, opened
from grader.submission.read.manifest import MANIFEST, read_manifest
from grader.submission.underlay.definition import Underlay, find_underlay
from grader.submission.underlay.fetch import fetch

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

CARRIED = carried_interfaces()
"""One folder for each package that the wheels lack and that is carried along."""
FOLDER = "underlays"
"""Name of the folder of underlays in a cache folder."""

# Raise it when the same sources would now be built differently.
_RECIPE = 1
_NOTE = "underlay.json"
# Thirty interfaces take 95 s of CPU, and rclcpp more.
_LIMITS = BuildLimits(
    python_s=1800.0, other_s=1800.0, room=replace(BUILD, cpu_s=3600, memory_bytes=4 * 2**30)
)

Say = Callable[[str], None]


def _silent(_: str) -> None:
    pass


@dataclass(frozen=True)
class Installed:
    """An underlay that was built, as ``underlay.json`` keeps it.

    Attributes:
        ros: The prefix of the ROS installation that it was built on.
        commits: Repository -> commit.
    """

    name: str
    given: str
    ros: str
    packages: tuple[str, ...]
    commits: dict[str, str]
    built: str
    duration_s: float


_INSTALLED = TypeAdapter(Installed)


class MissingUnderlay(GraderFault):
    """An underlay is not built on this machine."""

    def __init__(self, underlay: Underlay) -> None:
        """Name it, and the command that builds it."""
        super().__init__(
            f"the underlay {underlay.name!r} is not built here for this ROS installation; "
            f"to get it: {underlay.command}"
        )


class UnderlayStore:
    """What is built for one ROS installation, and builds what is not."""

    def __init__(
        self,
        cache: Path,
        ros: RosInstallation,
        on_progress: Say = _silent,
        sandbox: Sandbox | None = None,
    ) -> None:
        """Name the cache folder.

        Args:
            ros: Without underlays.
            sandbox: In which what was fetched is built.
        """
        self._folder = cache / FOLDER
        self._kept = BuildCache(self._folder, is_pruned=False)
        self._passing = BuildCache(cache)
        self._ros = ros
        self._say = on_progress
        self._sandbox = sandbox

    def lay(self, underlays: Iterable[Underlay]) -> RosInstallation:
        """The ROS installation with underlays; a later one is seen before those named earlier.

        Raises:
            MissingUnderlay: One of those that have to be fetched is not built.
            UsageError: Two of them have the same package.
        """
        ros = self._ros
        for underlay in underlays:
            if underlay.folder is not None:
                ros = on_top(ros, [self.folder_prefix(underlay.folder, ros)])
            else:
                ros = on_top(ros, self._prefixes(underlay))
        return ros

    def missing(self, underlays: Iterable[Underlay]) -> list[MissingUnderlay]:
        """Those that have to be fetched and are not there; quick."""
        found = []
        for underlay in underlays:
            try:
                if underlay.folder is None:
                    self._prefixes(underlay)
            except MissingUnderlay as missing:
                found.append(missing)
        return found

    def _prefixes(self, underlay: Underlay) -> list[Path]:
        """Install spaces of an underlay and of those that it requires; none if ROS has it all."""
        try:
            below = [path for one in _required(underlay) for path in self._prefixes(one)]
        except MissingUnderlay:
            # To add this one gets what it requires, too.
            raise MissingUnderlay(underlay) from None
        if not self._wanted(underlay):
            return below
        prefix = self._prefix(self._key(underlay))
        if not prefix.is_dir():
            raise MissingUnderlay(underlay)
        return list(dict.fromkeys([*below, prefix]))

    def _wanted(self, underlay: Underlay) -> frozenset[str]:
        """The packages that are built, where they are listed: those that ROS lacks."""
        return underlay.listed - self._ros.packages if underlay.listed else frozenset({"all"})

    def _key(self, underlay: Underlay) -> str:
        assert underlay.repos is not None
        required = [self._key(one) for one in _required(underlay) if self._wanted(one)]
        return self._digest(
            underlay.repos.model_dump_json(), sorted(self._wanted(underlay)), required
        )

    def _digest(self, *parts: object) -> str:
        whole = [_RECIPE, _ros_parts(self._ros), *parts]
        return hashlib.sha256(json.dumps(whole).encode()).hexdigest()

    def _prefix(self, key: str) -> Path:
        return self._folder / BUILDS / key / "install"

    def add(self, underlay: Underlay, answer_s: float) -> list[Installed]:
        """Build an underlay and what it requires, unless they are there; what was built."""
        done = [new for one in _required(underlay) for new in self.add(one, answer_s)]
        if not self._wanted(underlay):
            self._say(f"{underlay.name}: this ROS has its packages, nothing is built")
            return done
        python = underlay.repos.python if underlay.repos else ()
        for lack in not_installed(python, f"the underlay {underlay.name} needs"):
            raise GraderFault(lack)
        if underlay.folder is not None:
            return [*done, self._add_folder(underlay, underlay.folder)]
        key = self._key(underlay)
        if self._kept.find(key) is None or not (self._prefix(key).parent / _NOTE).is_file():
            below = [path for one in _required(underlay) for path in self._prefixes(one)]
            ros = on_top(self._ros, below)
            with Scratch("underlay") as staging:
                commits = self._fetch(underlay, staging, answer_s)
                built = self._build(underlay.name, staging, ros, self._kept, lambda _: key)
            done.append(self._note(underlay, key, built, commits))
        else:
            self._say(f"{underlay.name}: is there already")
        return done

    def _add_folder(self, underlay: Underlay, folder: Path) -> Installed:
        keys: list[str] = []

        def key(sha256: str) -> str:
            keys.append(self._digest(sha256, [], []))
            return keys[-1]

        built = self._build(underlay.name, folder, self._ros, self._kept, key)
        return self._note(replace(underlay, given=str(folder.resolve())), keys[-1], built, {})

    def _note(
        self, underlay: Underlay, key: str, built: CachedBuild, commits: dict[str, str]
    ) -> Installed:
        """Write down what was built; what was built of it before is thrown away."""
        prefix = self._prefix(key)
        installed = Installed(
            name=underlay.name,
            given=underlay.given,
            ros=str(self._ros.prefixes[0]),
            packages=tuple(sorted(indexed(prefix))),
            commits=commits,
            built=datetime.now().astimezone().isoformat(timespec="seconds"),
            duration_s=round(built.build.duration_s, 1),
        )
        for other, folder in self._entries():
            if (other.name, other.ros) == (installed.name, installed.ros) and folder.name != key:
                shutil.rmtree(folder)
        (prefix.parent / _NOTE).write_bytes(_INSTALLED.dump_json(installed, indent=1))
        return installed

    def _fetch(self, underlay: Underlay, staging: Path, answer_s: float) -> dict[str, str]:
        """Put the packages of all repositories side by side; the commits."""
        assert underlay.repos is not None
        commits: dict[str, str] = {}
        places: dict[str, str] = {}
        for name, repository in underlay.repos.repositories.items():
            files, commits[name] = fetch(name, repository, self._folder, answer_s, self._say)
            version = f"{name} {repository.version}"
            there = packages_in(files)
            for lacking in sorted(set(repository.packages) - there.keys()):
                raise UsageError(f"{underlay.given}: {version} has no package {lacking!r}")
            for package in repository.packages or sorted(there):
                other = places.setdefault(package, version)
                if other != version:
                    raise UsageError(
                        f"{underlay.given}: the package {package!r} is in {other} and in "
                        f"{version}: list in 'packages' of each repository which of its packages "
                        "to build"
                    )
                if not repository.packages or package in self._wanted(underlay) | {"all"}:
                    shutil.copytree(there[package], staging / package, symlinks=True)
        return commits

    def folder_prefix(
        self, folder: Path, ros: RosInstallation, names: Collection[str] | None = None
    ) -> Path:
        """The install space of the packages of a folder, built on ROS and underlays if need be.

        Args:
            names: Build these packages only.
        """
        below = [path.parent.name for path in ros.underlays]
        left_out = sorted(packages_in(folder).keys() - names) if names is not None else []

        def key(sha256: str) -> str:
            return self._digest(sha256, below, left_out)

        with opened(folder) as located:
            kept = self._prefix(key(located.sha256))
        if kept.is_dir():
            return kept
        built = self._build(folder.name, folder, ros, self._passing, key, names)
        assert built.install is not None
        return built.install

    def _build(
        self,
        name: str,
        packages: Path,
        ros: RosInstallation,
        cache: BuildCache,
        key: Callable[[str], str],
        names: Collection[str] | None = None,
    ) -> CachedBuild:
        """Build the packages in a folder, unless they are in the cache.

        Args:
            key: The name of the build in the cache, from the hash of the folder.
        """
        sandbox = self._sandbox

        def attempt(is_second: bool) -> CachedBuild:
            with opened(packages) as located:
                folders = _folders(located, packages)
                chosen = {one: at for one, at in folders.items() if names is None or one in names}
                total, begun = len(chosen), [0]

                def progress(what: str) -> None:
                    begun[0] += what.startswith("building ")
                    count = f" ({begun[0]} of {total})" if begun[0] else ""
                    self._say(f"{name}: {what}{count}, once on this machine")

                builder = Builder(
                    ros=ros,
                    cache=cache,
                    limits=_LIMITS,
                    sandbox=sandbox,
                    on_progress=progress,
                    is_second=is_second,
                )
                only_python = not any(
                    (located.root / at / "CMakeLists.txt").exists() for at in chosen.values()
                )
                if not only_python:
                    check_toolchain(ros.environment({})["PATH"])
                sources = Sources({file.path for file in located.files}, chosen)
                built = builder.build(
                    located,
                    sources,
                    only_python=only_python,
                    is_standalone=True,
                    key=key(located.sha256),
                )
                if built.install is None or not built.build.succeeded:
                    # What it lacked may be there the next time.
                    cache.discard(key(located.sha256))
                return built

        try:
            built = once_more(attempt)
        except SubmissionError as error:
            raise UsageError(f"{packages}: {error}") from error
        if built.install is None or not built.build.succeeded:
            failed = ", ".join(built.build.failed_packages) or name
            lacks = f" (this machine lacks {', '.join(built.build.lacking)})"
            raise GraderFault(
                f"{failed} in {packages if names is None else name} could not be built"
                f"{lacks if built.build.lacking else ''}: "
                f"{built.build.culprit or built.build.log[-2000:]}"
            )
        return built

    def installed(self) -> list[tuple[Installed, Path]]:
        """Every kept underlay of this ROS installation with its install space, by name."""
        mine = str(self._ros.prefixes[0])
        return [(one, at / "install") for one, at in self._entries() if one.ros == mine]

    def remove(self, name: str) -> int:
        """Remove a kept underlay by its name, also for installations of ROS that are gone."""
        mine = str(self._ros.prefixes[0])
        gone = [
            folder
            for one, folder in self._entries()
            if one.name == name and (one.ros == mine or not Path(one.ros).exists())
        ]
        for folder in gone:
            shutil.rmtree(folder)
        return len(gone)

    def _entries(self) -> list[tuple[Installed, Path]]:
        found = []
        for file in (self._folder / BUILDS).glob(f"*/{_NOTE}"):
            try:
                found.append((_INSTALLED.validate_json(file.read_bytes()), file.parent))
            except (OSError, ValidationError):
                continue
        return sorted(found, key=lambda entry: entry[0].name)

    def completed(self, ros: RosInstallation, named: Iterable[str]) -> RosInstallation:
        """Add to an installation what it lacks of the packages that are carried along."""
        if missing_tools(ros.environment({})["PATH"]):
            # What needs them will say so, and the rest of the submission is graded.
            return ros
        lacking = [name for name in sorted(set(named) - ros.packages) if (CARRIED / name).is_dir()]
        # Each for itself: it is the same build, whatever else is under the submission.
        prefixes = [self.folder_prefix(CARRIED / name, self._ros) for name in lacking]
        return replace(ros, underlays=(*ros.underlays, *prefixes)) if prefixes else ros


def on_top(ros: RosInstallation, prefixes: Sequence[Path]) -> RosInstallation:
    """A ROS installation with more install spaces; two must not have the same package."""
    for prefix in prefixes:
        if prefix in ros.underlays:
            continue
        for other in ros.underlays:
            for package in sorted(indexed(prefix) & indexed(other)):
                names = " and ".join(sorted(map(_words, (prefix, other))))
                raise UsageError(f"the package {package!r} is in two underlays, {names}: drop one")
        ros = replace(ros, underlays=(prefix, *ros.underlays))
    return ros


def indexed(prefix: Path) -> set[str]:
    """Names of the packages of an install space."""
    index = prefix / "share/ament_index/resource_index/packages"
    return {entry.name for entry in index.iterdir()} if index.is_dir() else set()


def _words(prefix: Path) -> str:
    """What an install space is of."""
    try:
        return _INSTALLED.validate_json((prefix.parent / _NOTE).read_bytes()).given
    except (OSError, ValidationError):
        return "the packages of the assignment"


def packages_in(folder: Path) -> dict[str, Path]:
    """The packages below a folder: name -> place."""
    paths = (path.relative_to(folder).as_posix() for path in folder.rglob("*"))
    return {_package_name(folder / found): folder / found for found in find_packages(paths)}


def _required(underlay: Underlay) -> list[Underlay]:
    return [find_underlay(name) for name in underlay.repos.requires] if underlay.repos else []


def _folders(located: Located, packages: Path) -> dict[str, str]:
    """Package -> its folder in the copy."""
    found: dict[str, str] = {}
    for folder in located.packages:
        name = _package_name(located.root / folder)
        if name in found:
            raise UsageError(
                f"{packages}: the package {name!r} is there twice: {found[name]} and {folder}"
            )
        found[name] = folder
    if not found:
        raise UsageError(f"{packages}: there is no package in it (no {MANIFEST})")
    return found


def _package_name(folder: Path) -> str:
    name = read_manifest((folder / MANIFEST).read_bytes(), MANIFEST, {}).name
    return name or folder.name


def _ros_parts(ros: RosInstallation) -> list[object]:
    """What an underlay depends on of a ROS installation."""
    wheels = [path.name for one in ros.site_packages for path in one.glob("ros_*.dist-info")]
    index = [prefix / "share/ament_index/resource_index/packages" for prefix in ros.prefixes]
    changed = [at.stat().st_mtime_ns for at in index if ros.source == "sourced" and at.is_dir()]
    folders = sorted({path.parent.name for path in ros.site_packages})
    return [
        ros.source,
        ros.distro,
        str(ros.python),
        [str(prefix) for prefix in ros.prefixes],
        sorted(wheels),
        folders,
        changed,
    ]
