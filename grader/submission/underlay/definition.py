"""What an underlay is made of: a named set, a ``.repos`` file, or a folder of packages.

A ``.repos`` file has vcstool's format: name -> type, url, version. A named set is such a file that
comes with rosgrade. The other keys are rosgrade's, and optional.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from grader.errors import UsageError
from grader.spec.name import PackageName
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Model, read_source

SETS = Path(__file__).with_name("sets")
"""One ``.repos`` file for each named set."""
SUFFIX = ".repos"


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
        requires: Named sets that it is built on.
        python: Python libraries that its packages import.
        by_need: Whether a submission that names one of its packages gets it where it is built, also
            if the assignment does not name it.
    """

    repositories: dict[str, Repository] = Field(min_length=1)
    requires: tuple[str, ...] = ()
    python: tuple[str, ...] = ()
    by_need: bool = False


@dataclass(frozen=True)
class Underlay:
    """Packages that are built together.

    Attributes:
        given: How it is named after ``rosgrade underlay add``.
        repos: Where its packages come from, if they have to be fetched.
        folder: The folder with its packages, if not.
    """

    name: str
    given: str
    repos: Repos | None = None
    folder: Path | None = None

    @property
    def place(self) -> str:
        """Where it is defined: courses may have files or folders of one name."""
        is_set = self.repos is not None and self.given == self.name
        return self.name if is_set else str(Path(self.given).resolve())

    @property
    def listed(self) -> frozenset[str]:
        """Its packages, where all of them are listed."""
        parts = [one.packages for one in self.repos.repositories.values()] if self.repos else [()]
        return frozenset(name for part in parts for name in part) if all(parts) else frozenset()

    @property
    def python(self) -> tuple[str, ...]:
        """Python libraries that its packages import."""
        return self.repos.python if self.repos else ()

    @property
    def by_need(self) -> bool:
        """Whether submissions get it that need it, also if the assignment does not name it."""
        return self.repos is not None and self.repos.by_need


def named_sets() -> tuple[str, ...]:
    """Names of the sets that come with rosgrade."""
    return tuple(sorted(file.stem for file in SETS.glob(f"*{SUFFIX}")))


def sets_with(packages: Collection[str]) -> list[Underlay]:
    """The named sets that have one of some packages."""
    found = map(find_underlay, named_sets())
    return [one for one in found if not one.listed.isdisjoint(packages)]


def ways_to_get(packages: Collection[str]) -> str:
    """How an instructor gives some packages to submissions, or nothing if no named set has them."""
    ways = [
        f"`rosgrade underlay add {one.name}` on that machine"
        if one.by_need
        else f"`underlays: [{one.name}]` in assignment.yaml"
        for one in sets_with(packages)
    ]
    return " and ".join(ways)


def find_underlay(given: str, beside: Path = Path()) -> Underlay:
    """Find an underlay by the name of a set, or by a path.

    Args:
        beside: The folder that a path is relative to.

    Raises:
        UsageError: There is none.
        AssignmentError: Its file is wrong.
    """
    path = beside / given
    if given in named_sets():
        return Underlay(given, given, _read(SETS / f"{given}{SUFFIX}"))
    if path.suffix == SUFFIX:
        return Underlay(path.stem, str(path), _read(path))
    if path.is_dir():
        return Underlay(path.resolve().name, str(path), folder=path)
    raise UsageError(
        f"no underlay {given!r}.{nearest_or_all(given, named_sets(), 'The named sets are')} "
        f"Another is named by its {SUFFIX} file or by the folder of its packages."
    )


def _read(file: Path) -> Repos:
    return read_source(file).read(Repos)
