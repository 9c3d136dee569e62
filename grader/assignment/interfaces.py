"""Whether the interfaces that an assignment names exist, as far as it shows without a run."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from grader import resources, ros
from grader.assignment.binding import BoundCheck
from grader.assignment.model import Assignment
from grader.errors import GraderFault, Problem
from grader.recording.interface import DefinitionError, sections_of
from grader.spec.document import Place
from grader.spec.name import INTERFACE
from grader.spec.nearest_name import did_you_mean
from grader.spec.source import Source
from grader.submission.read.rosdistro import PACKAGES

FOLDER = "interfaces"
"""Beside ``assignment.yaml``: our copy of the interface packages that the student writes."""

_MANIFEST = "package.xml"
# Parameters of checks that name an interface.
_PARAMETERS = ("type", "interface")


@dataclass(frozen=True)
class Interfaces:
    """Definitions that are at hand.

    Attributes:
        own: Package -> its folder, of the assignment and of rosgrade; the first win.
        prefixes: ament prefixes of ROS; None where it is not installed.
    """

    own: Mapping[str, Path]
    prefixes: Sequence[Path] | None

    @classmethod
    def of(cls, folder: Path) -> Interfaces:
        """Look around."""
        files = [*resources.carried_interfaces().glob(f"*/{_MANIFEST}")]
        files += sorted((folder / FOLDER).rglob(_MANIFEST))
        try:
            prefixes: Sequence[Path] | None = ros.find().prefixes
        except GraderFault:
            prefixes = None
        return cls({file.parent.name: file.parent for file in files}, prefixes)

    def find(self, interface: str) -> str:
        """The text of a definition.

        Raises:
            KeyError: There is none at hand.
        """
        package, kind, name = interface.split("/")
        for folder in self._folders(package):
            file = folder / kind / f"{name}.{kind}"
            if file.is_file():
                return file.read_text(encoding="utf-8", errors="replace")
        raise KeyError(interface)

    def has(self, interface: str) -> bool:
        """Whether a definition is at hand."""
        try:
            self.find(interface)
        except KeyError:
            return False
        return True

    def names(self, package: str, kind: str) -> list[str]:
        """Names of the interfaces of one kind in a package."""
        files = (file for at in self._folders(package) for file in (at / kind).glob(f"*.{kind}"))
        return sorted({file.stem for file in files})

    @cached_property
    def packages(self) -> set[str]:
        """Every package with interfaces, or that is known to be one of ROS."""
        indices = (prefix / "share/ament_index/resource_index" for prefix in self.prefixes or ())
        found = {file.name for index in indices for file in index.glob("rosidl_interfaces/*")}
        return found | set(self.own)

    def _folders(self, package: str) -> list[Path]:
        own = [self.own[package]] if package in self.own else []
        return [*own, *(prefix / "share" / package for prefix in self.prefixes or ())]


def problems(
    source: Source, assignment: Assignment, checks: Sequence[BoundCheck], known: Interfaces
) -> Iterator[Problem]:
    """Find interfaces that are neither in ROS, nor beside the assignment, nor handed in.

    A package of Jazzy that is not installed here, and one that the solution ``depends`` on, may
    well have it: another machine will tell.

    Args:
        checks: Its checks, in order.
    """
    handed_in = {package.name for package in assignment.packages}
    elsewhere = {name for package in assignment.packages for name in package.depends} | PACKAGES
    for place, interface in _played(assignment):
        package = interface.split("/")[0]
        if package in handed_in and not known.has(interface) and package not in known.own:
            text = (
                f"{package!r} is handed in, and the probe never imports what a student wrote: our "
                f"own copy of it must be in {FOLDER}/{package} beside the assignment"
            )
            yield source.problem(place, text)
        else:
            yield from _unknown(source, place, interface, elsewhere, known)
    for place, interface in _judged(checks):
        if interface.split("/")[0] not in handed_in:
            yield from _unknown(source, place, interface, elsewhere, known)


def _unknown(
    source: Source, place: Place, interface: str, elsewhere: set[str], known: Interfaces
) -> Iterator[Problem]:
    if known.has(interface):
        circle = _circle((interface,), known, set())
        if circle:
            text = f"no message can hold itself: {' -> '.join(circle)}"
            yield source.problem(place, text)
        return
    package, kind, name = interface.split("/")
    if package in known.packages:
        names = known.names(package, kind)
        listed = f" It has: {', '.join(names[:10])}." if names else ""
        where = f"{FOLDER}/{package}" if package in known.own else package
        text = f"{where} has no {kind} {name!r}.{did_you_mean(name, names) or listed}"
        yield source.problem(place, text)
    elif known.prefixes is not None and package not in elsewhere:
        text = (
            f"there is no package {package!r}: not in ROS, not in {FOLDER}/ beside the assignment, "
            "not among 'packages' nor what they have in 'depends'."
        )
        yield source.problem(place, text + did_you_mean(package, known.packages))


def _circle(way: tuple[str, ...], known: Interfaces, seen: set[str]) -> tuple[str, ...]:
    """The way from an interface through its fields until one comes again; nothing if none does.

    Args:
        seen: Those that lead to no circle; more are added.
    """
    try:
        sections = sections_of(way[-1], known.find(way[-1]))
    except (KeyError, DefinitionError):
        # What is missing or broken here may be there and right where it is built.
        sections = ()
    types = (field.type for part in sections for field in part.fields if field.is_message)
    for inner in dict.fromkeys(types):
        if inner in way:
            return (*way[way.index(inner) :], inner)
        if inner not in seen:
            circle = _circle((*way, inner), known, seen)
            if circle:
                return circle
    seen.add(way[-1])
    return ()


def _played(assignment: Assignment) -> Iterator[tuple[Place, str]]:
    """Interfaces that the probe itself imports."""
    for index, scenario in enumerate(assignment.scenarios):
        for key, items in (("record", scenario.record), ("stimuli", scenario.stimuli)):
            for number, item in enumerate(items):
                interface = getattr(item, "type", None)
                if isinstance(interface, str):
                    yield ("scenarios", index, key, number, "type"), interface


def _judged(checks: Sequence[BoundCheck]) -> Iterator[tuple[Place, str]]:
    """Interfaces that checks only name."""
    for index, bound in enumerate(checks):
        for key in _PARAMETERS:
            interface = getattr(bound.parameters, key, None)
            if isinstance(interface, str) and re.fullmatch(INTERFACE, interface):
                yield ("checks", index, "with", key), interface
