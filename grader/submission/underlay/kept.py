"""What was built for underlays and is kept, each build with a note of what asked for it."""

from __future__ import annotations

import shutil
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from grader.errors import UsageError
from grader.machine.resources import BUILDS, INSTALL
from grader.machine.ros import RosInstallation
from grader.submission.build.build_cache import BuildCache

_NOTE = "underlay.json"


@dataclass(frozen=True)
class Installed:
    """An underlay that was built, as ``underlay.json`` keeps it.

    Attributes:
        name: Of the package of ROS 2, or of the file or folder that it was built from.
        ros: The prefix of the ROS installation that it was built on.
        places: What asked for it: names of packages and sets, files, folders. If nothing asks for
            it any more, it is thrown away.
        snapshot: The day of the index that the package is of. Only packages of ROS 2 have this
            and what follows.
        installation: The state of the ROS installation, as a hash.
        commit: Of its sources.
        needs: Other packages of the index that it needs.
    """

    name: str
    ros: str
    packages: tuple[str, ...]
    places: tuple[str, ...] = ()
    snapshot: str = ""
    version: str = ""
    installation: str = ""
    commit: str = ""
    needs: tuple[str, ...] = ()

    @property
    def asked_by(self) -> tuple[str, ...]:
        """What asked for it; the first notes did not say."""
        return self.places or (self.name,)

    @property
    def is_used(self) -> bool:
        """Whether it is of a kind that is used: earlier, a set of packages was one build."""
        return bool(self.snapshot) or any(Path(place).is_absolute() for place in self.places)


_INSTALLED = TypeAdapter(Installed)


class Kept:
    """The builds of underlays in one cache, as one ROS installation sees them."""

    def __init__(self, folder: Path, ros: RosInstallation) -> None:
        """Name the folder of underlays."""
        self.cache = BuildCache(folder, is_pruned=False)
        self._folder = folder / BUILDS
        self._ros = str(next(iter(ros.prefixes), ""))

    def has(self, key: str) -> bool:
        """Whether a build is there, whole and noted."""
        return self.find(key) is not None and self.cache.find(key) is not None

    def find(self, key: str) -> Path | None:
        """The install space of a build that is noted, or None."""
        return self.install(key) if (self._folder / key / _NOTE).is_file() else None

    def install(self, key: str) -> Path:
        """Where the install space of a build is, or will be."""
        return self._folder / key / INSTALL

    def installed(self) -> list[tuple[Installed, Path]]:
        """Every build for this ROS installation with its install space, by name."""
        return [
            (note, folder / INSTALL)
            for note, folder in self._entries()
            if note.ros == self._ros and note.is_used
        ]

    def note(self, key: str, about: Installed) -> None:
        """Keep a build also for what now asks for it."""
        before = _read(self._folder / key)
        places = {*about.places, *(before.places if before else ())}
        note = replace(about, ros=self._ros, places=tuple(sorted(places)))
        if note != before:
            self._write(self._folder / key, note)

    def settle(self, place: str, keys: Collection[str]) -> None:
        """Let one place ask for these builds and no others; what nothing asks for is removed."""
        for note, folder in self._removable():
            if folder.name not in keys and place in note.asked_by:
                others = tuple(name for name in note.asked_by if name != place)
                if others:
                    self._write(folder, replace(note, places=others))
                else:
                    shutil.rmtree(folder)

    def remove(self, name: str) -> bool:
        """Remove what a name or place asked for, also for installations that are gone.

        Raises:
            UsageError: Several places have the name, or another place needs it.
        """
        notes = [note for note, _ in self._removable()]
        of_this_name = [note for note in notes if note.name == name]
        if any(name in note.asked_by for note in notes):
            places = {name}
        else:
            # A file or a folder of a course, by its name alone.
            courses = (note for note in of_this_name if not note.snapshot)
            places = {place for note in courses for place in note.asked_by}
        if len(places) > 1:
            each = " or ".join(sorted(places))
            raise UsageError(f"several underlays are called {name!r}: remove {each}")
        if not places and of_this_name:
            by = sorted({place for note in of_this_name for place in note.asked_by})
            raise UsageError(f"{name!r} is here because of {', '.join(by)}: remove that")
        for place in places:
            self.settle(place, ())
        return bool(places)

    def _removable(self) -> list[tuple[Installed, Path]]:
        """Builds for this ROS installation, and for installations that are gone."""
        return [
            (note, folder)
            for note, folder in self._entries()
            if note.ros == self._ros or not Path(note.ros).exists()
        ]

    def _entries(self) -> list[tuple[Installed, Path]]:
        """Every build in the cache with its folder, by name."""
        entries = []
        for file in self._folder.glob(f"*/{_NOTE}"):
            note = _read(file.parent)
            if note is not None:
                entries.append((note, file.parent))
        return sorted(entries, key=lambda entry: entry[0].name)

    def _write(self, folder: Path, note: Installed) -> None:
        (folder / _NOTE).write_bytes(_INSTALLED.dump_json(note, indent=1))


def _read(folder: Path) -> Installed | None:
    try:
        return _INSTALLED.validate_json((folder / _NOTE).read_bytes())
    except (OSError, ValidationError):
        return None
