"""What an underlay is made of: packages of ROS 2, a ``.repos`` file, or a folder of packages.

A package of ROS 2 Jazzy is named as in its index; some names stand for several. A ``.repos`` file
has vcstool's format: name -> type, url, version. Its other keys are rosgrade's, and optional.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from grader.errors import UsageError
from grader.spec.name import ID, PackageName
from grader.spec.nearest_name import nearest, nearest_or_all
from grader.spec.source import Model, read_source
from grader.submission.read.rosdistro import PACKAGES, PYTHON_MODULES

_VERBS = ("run", "topic", "node", "pkg", "interface", "service", "param", "action", "lifecycle")
_COMMAND = ("ros2cli", *(f"ros2{verb}" for verb in _VERBS))
SETS: dict[str, tuple[str, ...]] = {
    "ament_cmake_auto": ("ament_cmake_auto",),
    "launch": ("launch", "launch_xml", "launch_yaml", "launch_ros", "ros2launch", *_COMMAND),
    "rclcpp": ("rclcpp",),
    "ros2cli": _COMMAND,
    "tf2": ("tf2_ros_py", "tf2_tools"),
}
"""What courses need most: a name -> the packages that it stands for."""
SUFFIX = ".repos"
_USUAL = "The usual ones are"


class Repository(Model):
    """A git repository at a version that does not move."""

    type: Literal["git"] = Field(description="How it is fetched.")
    url: str = Field(min_length=1, description="Where it is.")
    version: str = Field(min_length=1, description="A tag, or the 40 digits of a commit.")
    commit: Annotated[str, Field(pattern="^[0-9a-f]{40}$")] | None = Field(
        None, description="The commit that the tag must stand for."
    )
    packages: tuple[PackageName, ...] = Field(
        (), description="Packages of it that are built; by default all."
    )


class Repos(Model):
    """A ``.repos`` file.

    Attributes:
        requires: Packages of ROS 2, or sets of them, that it is built on.
        python: Python libraries that its packages import.
    """

    repositories: dict[str, Repository] = Field(min_length=1)
    requires: tuple[str, ...] = ()
    python: tuple[str, ...] = ()


@dataclass(frozen=True)
class Underlay:
    """Packages that are asked for together: exactly one of the last three says which.

    Attributes:
        given: How it is named after ``rosgrade underlay add``.
        packages: Their names in the index of ROS 2.
        repos: Where they come from, if not from there.
        folder: The folder with them.
    """

    name: str
    given: str
    packages: tuple[str, ...] = ()
    repos: Repos | None = None
    folder: Path | None = None

    @property
    def place(self) -> str:
        """Where it is defined: courses may have files or folders of one name."""
        return self.name if self.packages else str(Path(self.given).resolve())

    @property
    def listed(self) -> frozenset[str]:
        """Its packages, where all of them are listed."""
        if self.repos is None:
            return frozenset(self.packages)
        lists = [repository.packages for repository in self.repos.repositories.values()]
        return frozenset[str]().union(*lists) if all(lists) else frozenset()

    @property
    def required(self) -> tuple[Underlay, ...]:
        """What it is built on."""
        return tuple(packages_of_ros(name) for name in self.repos.requires) if self.repos else ()


def packages_of_ros(name: str) -> Underlay:
    """Packages of ROS 2 by the name of one, or of a set.

    Raises:
        UsageError: It cannot be the name of a package.
    """
    if name in SETS:
        return Underlay(name, name, SETS[name])
    near = nearest(name, SETS)
    if name not in PACKAGES and (near is not None or not re.fullmatch(ID, name)):
        raise UsageError(f"no underlay {name!r}.{nearest_or_all(name, SETS, _USUAL)}")
    return Underlay(name, name, (name,))


def ways_to_get(packages: Collection[str]) -> str:
    """How an instructor gives some packages to submissions, or nothing if they are not of ROS 2."""
    smallest_first = sorted(SETS, key=lambda name: len(SETS[name]))
    names = {
        next((one for one in smallest_first if package in SETS[one]), package)
        for package in set(packages) & PACKAGES
    }
    return f"`rosgrade underlay add {' '.join(sorted(names))}` on that machine" if names else ""


def providers(names: Collection[str]) -> frozenset[str]:
    """Packages of some names, and those that have a Python module of the name."""
    return frozenset(names).union(*(PYTHON_MODULES.get(name, ()) for name in names))


def find_underlay(given: str, beside: Path = Path()) -> Underlay:
    """Find an underlay by the name of a package or set, or by a path.

    Args:
        beside: The folder that a path is relative to.

    Raises:
        UsageError: There is none.
        AssignmentError: Its file is wrong.
    """
    path = beside / given
    if given in SETS or given in PACKAGES:
        return packages_of_ros(given)
    if path.suffix == SUFFIX:
        return Underlay(path.stem, str(path), repos=read_source(path).read(Repos))
    if path.is_dir():
        return Underlay(path.resolve().name, str(path), folder=path)
    if re.fullmatch(ID, given):
        return packages_of_ros(given)
    raise UsageError(
        f"no underlay {given!r}.{nearest_or_all(given, SETS, _USUAL)} Another is a package of "
        f"ROS 2, a {SUFFIX} file, or a folder of packages"
    )
