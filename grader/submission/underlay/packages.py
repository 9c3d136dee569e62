"""Packages of ROS 2 from its index: built on this machine, each once for all that need it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from grader.errors import GraderFault
from grader.machine.ros import DISTRO, RosInstallation
from grader.submission.build.toolchain import has_headers, headers_package, missing_tools
from grader.submission.underlay.building import Building, digest
from grader.submission.underlay.definition import Underlay
from grader.submission.underlay.distribution import (
    SNAPSHOT,
    Distribution,
    Release,
    fetch_distribution,
)
from grader.submission.underlay.fetch import commit_of, fetch
from grader.submission.underlay.kept import Installed, Kept
from grader.submission.underlay.resolve import Sources, closure, resolve
from grader.submission.underlay.system_libraries import (
    System,
    is_of_python,
    not_importable,
    this_system,
)


@dataclass(frozen=True)
class Packages:
    """The packages of one ROS installation.

    Attributes:
        folder: Of underlays, in the cache.
        ros: Without underlays.
    """

    folder: Path
    ros: RosInstallation
    kept: Kept
    building: Building

    def built(self) -> dict[str, tuple[Installed, Path]]:
        """What is built of the index as it is pinned, for the installation as it is now."""
        state = digest(self.ros)
        return {
            note.name: (note, install)
            for note, install in self.kept.installed()
            if note.snapshot == SNAPSHOT.version and note.installation == state
        }

    def chain(self, names: Iterable[str]) -> list[Path] | None:
        """Install spaces of packages and of all that they need, the highest first.

        What ROS has is left out. None where one is not built.
        """
        built = self.built()
        lowest_first: dict[str, Path] = {}

        def visit(name: str) -> None:
            if name not in lowest_first:
                note, install = built[name]
                for needed in note.needs:
                    visit(needed)
                lowest_first[name] = install

        try:
            for name in sorted(set(names) - self.ros.packages):
                visit(name)
        except KeyError:
            return None
        return [*reversed(lowest_first.values())]

    def add(self, underlays: Sequence[Underlay], answer_s: float) -> list[str]:
        """Build packages that are not there, with all that they need; names of what was built.

        What was built stays if a later one fails.

        Args:
            answer_s: Longest time until a git server answers.

        Raises:
            UsageError: There is no such package, or versions contradict each other.
            GraderFault: Something cannot be fetched or built, or libraries are missing.
        """
        missing = [underlay for underlay in underlays if not self._is_there(underlay)]
        if not missing:
            return []
        say = self.building.say
        distribution = fetch_distribution(self.folder, answer_s, say)
        say(f"packages of ROS 2 {DISTRO.title()} as of {SNAPSHOT.version.rpartition('/')[2]}")

        def get(release: Release) -> Path:
            return fetch(release.name, release.source, self.folder, answer_s, say)

        names = {name for underlay in missing for name in underlay.packages}
        plan = resolve(names, distribution, self.ros, get)
        notes = [self._note(sources) for sources in plan]
        keys: dict[str, str] = {}
        for note in notes:
            keys[note.name] = self.key(note, keys)
        todo = [sources for sources in plan if not self.kept.has(keys[sources.release.name])]
        self._ask_for_libraries(todo, distribution)
        releases = [sources.release for sources in todo]
        if releases:
            say("to build: " + ", ".join(f"{one.name} {one.version}" for one in releases))
        needed_by = {underlay.place: closure(underlay.packages, plan) for underlay in missing}
        for sources, note in zip(plan, notes, strict=True):
            if sources in todo:
                self._build(sources, keys, todo)
            places = tuple(place for place, needed in needed_by.items() if note.name in needed)
            self.kept.note(keys[note.name], replace(note, places=places))
        for place, needed in needed_by.items():
            self.kept.settle(place, [keys[name] for name in needed])
        return [release.name for release in releases]

    def _is_there(self, underlay: Underlay) -> bool:
        """Whether nothing has to be built; what is built already is kept for this name, too."""
        if self.ros.packages.issuperset(underlay.packages):
            self.building.say(f"{underlay.name}: this ROS has its packages, nothing is built")
            return True
        paths = self.chain(underlay.packages)
        if paths is None:
            return False
        keys = [path.parent.name for path in paths]
        if not all(map(self.kept.has, keys)):
            return False
        self.building.say(f"{underlay.name}: is there already")
        for note, install in self.built().values():
            if install in paths:
                self.kept.note(install.parent.name, replace(note, places=(underlay.place,)))
        self.kept.settle(underlay.place, keys)
        return True

    def _build(self, source: Sources, keys: dict[str, str], todo: Sequence[Sources]) -> None:
        name, say = source.release.name, self.building.say
        counted = f"{name} ({todo.index(source) + 1} of {len(todo)}, once on this machine)"

        def tell(what: str) -> None:
            if what.startswith("building "):
                say(f"building {counted}")

        below = self.chain(source.needs)
        if below is None:
            raise GraderFault(
                "what was built before is gone, or the ROS installation was changed meanwhile: run "
                "the command again"
            )
        ros = replace(self.ros, underlays=tuple(below))
        building = replace(self.building, say=tell)
        building.build(source.folder, ros, self.kept.cache, keys[name])

    def _note(self, source: Sources) -> Installed:
        release = source.release
        return Installed(
            release.name,
            str(self.ros.prefixes[0]),
            (release.name,),
            snapshot=SNAPSHOT.version,
            version=release.version,
            installation=digest(self.ros),
            commit=commit_of(source.folder),
            needs=tuple(sorted(source.needs)),
        )

    def key(self, note: Installed, keys: dict[str, str]) -> str:
        """The name of the build of a package; those of what it needs are known."""
        below = [keys[name] for name in note.needs if name in keys]
        return digest(self.ros, note.name, note.commit, below)

    def _ask_for_libraries(self, plan: Sequence[Sources], distribution: Distribution) -> None:
        """See that the system has what packages need.

        Raises:
            GraderFault: They cannot be built without what is missing.
        """
        system, say = this_system(), self.building.say
        build_keys = {key for one in plan for key in one.build_keys}
        run_keys = {key for one in plan for key in one.run_keys} - build_keys
        if self.ros.source == "wheels":
            # Beside the wheels Python and its libraries do not come from the system.
            of_python = {key for key in build_keys | run_keys if is_of_python(key)}
            build_keys, run_keys = build_keys - of_python, run_keys - of_python
            doubtful = not_importable(of_python)
            if doubtful:
                say(f"perhaps not beside {self.ros.python}: {', '.join(doubtful)}")
        missing = _missing_tools(plan, self.ros)
        names = []
        for sources in plan:
            lacking = _lacking(system, distribution, sources.build_keys & build_keys)
            if lacking:
                names.append(sources.release.name)
                missing += lacking
        if missing:
            raise GraderFault(
                f"nothing was built, because {', '.join(names) or 'compiling'} takes what this "
                f"machine lacks. To get it: sudo apt install {' '.join(sorted(set(missing)))}"
            )
        later = _lacking(system, distribution, run_keys)
        if later:
            say(f"used when they run, but not here: sudo apt install {' '.join(later)}")


def _missing_tools(plan: Sequence[Sources], ros: RosInstallation) -> list[str]:
    if not any((one.folder / "CMakeLists.txt").exists() for one in plan):
        return []
    tools = missing_tools(ros.environment({})["PATH"])
    return tools if has_headers() else [*tools, headers_package()]


def _lacking(system: System, distribution: Distribution, keys: Collection[str]) -> list[str]:
    return system.lacking(distribution.keys[key] for key in sorted(keys))
