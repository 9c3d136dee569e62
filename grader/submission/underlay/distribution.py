"""The packages of ROS 2 Jazzy as its official index lists them (REP-143), as of one day.

The index is the git repository ros/rosdistro. It names for each package the release repository and
the tag with its sources, and for each rosdep key the packages of Debian and Ubuntu.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, TypeAdapter, ValidationError

from grader.errors import GraderFault, UsageError
from grader.machine.ros import DISTRO
from grader.spec.nearest_name import did_you_mean
from grader.submission.underlay.definition import Repository
from grader.submission.underlay.fetch import fetch

SNAPSHOT = Repository(
    type="git",
    url="https://github.com/ros/rosdistro.git",
    # The day whose versions are those of the wheels (see pyproject.toml).
    version="jazzy/2025-10-14",
    commit="78119b5887b14ddd796d2fba455389916c04db5f",
)
"""The index that every package is taken from."""

_T = TypeVar("_T")
_NAME = "the index of ROS 2"
_INDEX = "index-v4.yaml"
_KEYS = ("rosdep/base.yaml", "rosdep/python.yaml")
# The index has 20,000 lines, which the loader that is not C reads in eight seconds.
_LOADER = yaml.CSafeLoader


class _Files(BaseModel):
    """Of one distribution, in the index."""

    distribution: tuple[str, ...]


class _Index(BaseModel):
    distributions: dict[str, _Files]


class _Released(BaseModel):
    """What was released of a repository; without a version it is about to be."""

    url: str
    version: str | None = None
    packages: tuple[str, ...] = ()
    tags: dict[str, str] = {}


class _Entry(BaseModel):
    release: _Released | None = None


class _Distribution(BaseModel):
    repositories: dict[str, _Entry]


_Keys = TypeAdapter(dict[str, dict[str, Any]])


@dataclass(frozen=True)
class Release:
    """A package of the distribution: its version, and where its sources are."""

    name: str
    version: str
    source: Repository


@dataclass(frozen=True)
class Distribution:
    """All packages that were released, and all rosdep keys.

    Attributes:
        unreleased: Repositories of which the index names the sources, but no release.
        keys: rosdep key -> system (``debian``) -> rule, as REP-111 defines it.
    """

    releases: Mapping[str, Release]
    unreleased: frozenset[str]
    keys: Mapping[str, Mapping[str, Any]]

    def release(self, name: str) -> Release:
        """The release of a package.

        Raises:
            UsageError: There is none.
        """
        if name in self.releases:
            return self.releases[name]
        if name in self.unreleased:
            raise UsageError(
                f"{name!r} was not released for ROS 2 Jazzy: the index only names its sources. "
                "Name them in a .repos file of yours"
            )
        near = did_you_mean(name, self.releases)
        raise UsageError(f"ROS 2 Jazzy has no package {name!r} ({SNAPSHOT.version}).{near}")


def fetch_distribution(
    folder: Path, answer_s: float, on_progress: Callable[[str], None]
) -> Distribution:
    """Read the index, which is fetched once.

    Args:
        folder: The folder of underlays.
        answer_s: Longest time until the server answers.

    Raises:
        GraderFault: It cannot be reached, or is damaged.
    """
    return read_distribution(fetch(_NAME, SNAPSHOT, folder, answer_s, on_progress))


def read_distribution(files: Path) -> Distribution:
    """Read the index in a folder.

    Raises:
        GraderFault: It is damaged.
    """
    index = _read(files, _INDEX, TypeAdapter(_Index))
    if DISTRO not in index.distributions:
        raise _damaged(files, _INDEX, f"it does not name {DISTRO}")
    releases: dict[str, Release] = {}
    unreleased = set()
    for file in index.distributions[DISTRO].distribution:
        for repository, entry in _read(
            files, file, TypeAdapter(_Distribution)
        ).repositories.items():
            released = entry.release
            if released is None or released.version is None:
                unreleased.add(repository)
                continue
            if "release" not in released.tags:
                raise _damaged(files, file, f"{repository} has no tag of its release")
            for name in released.packages or (repository,):
                tag = released.tags["release"].replace("{package}", name)
                tag = tag.replace("{version}", released.version)
                source = Repository(type="git", url=released.url, version=tag)
                releases[name] = Release(name, released.version.rpartition("-")[0], source)
    keys = {key: rule for file in _KEYS for key, rule in _read(files, file, _Keys).items()}
    return Distribution(releases, frozenset(unreleased), keys)


def _read(files: Path, name: str, form: TypeAdapter[_T]) -> _T:
    try:
        text = (files / name).read_text(encoding="utf-8")
        return form.validate_python(yaml.load(text, Loader=_LOADER))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise _damaged(files, name, f"{place}: {first['msg']}") from error
    except (OSError, UnicodeError, yaml.YAMLError) as error:
        reason = error.strerror if isinstance(error, OSError) else " ".join(str(error).split())
        raise _damaged(files, name, str(reason)) from error


def _damaged(files: Path, name: str, reason: str) -> GraderFault:
    return GraderFault(
        f"{_NAME} is damaged ({name}: {reason}). To fetch it again: rm -r {files.parent}"
    )
