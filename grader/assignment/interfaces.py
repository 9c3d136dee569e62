"""Whether interfaces that an assignment names exist, and have the fields that checks name.

A check of a field that its message does not have would end as an error for every student.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from grader.assignment.binding import BoundCheck
from grader.assignment.model import Assignment
from grader.assignment.stimuli.message import Find, part_of
from grader.assignment.variable import Values, fill_interface, fill_text
from grader.checks.check import NamedFields
from grader.errors import GraderFault, Problem
from grader.findings.expected import expected_leaves, unreachable
from grader.findings.value import NoSuchField, tolerance_of, value_at
from grader.machine import resources, ros
from grader.recording.interface import FEEDBACK, FLOATS, TEXTS, feedback_definition, fields_of
from grader.spec.document import Place
from grader.spec.name import INTERFACE
from grader.spec.nearest_name import did_you_mean, nearest_or_all
from grader.spec.source import Source
from grader.submission.read.rosdistro import PACKAGES
from grader.submission.underlay.definition import Underlay, find_underlay

FOLDER = "interfaces"
"""Beside ``assignment.yaml``: our copy of the interface packages that the student writes."""
FOLDERS = ("packages", FOLDER)
"""Beside ``assignment.yaml``: packages that lie under the submissions."""

_MANIFEST = "package.xml"


_INDEX = re.compile(r"\[\d+\]")
_ZERO = {"bool": False, **dict.fromkeys(FLOATS, 0.0), **dict.fromkeys(TEXTS, "")}


@dataclass(frozen=True)
class Interfaces:
    """The interface definitions that can be read on this machine.

    Attributes:
        own: Package -> its folder, of the assignment and of rosgrade; the first win.
        prefixes: ament prefixes of ROS; None where it is not installed.
        values: What stands for the variables in ``own``.
    """

    own: Mapping[str, Path]
    prefixes: Sequence[Path] | None
    values: Values

    @classmethod
    def of(cls, folder: Path, values: Values, underlays: Sequence[str] = ()) -> Interfaces:
        """Look around; without an underlay that is not built here, ROS is as good as not there."""
        named = [find_underlay(underlay, folder) for underlay in underlays]
        manifests = [*resources.carried_interfaces().glob(f"*/{_MANIFEST}")]
        manifests += sorted(file for name in FOLDERS for file in (folder / name).rglob(_MANIFEST))
        for underlay in named:
            if underlay.folder:
                manifests += underlay.folder.rglob(_MANIFEST)
        own = {fill_text(file.parent.name, values): file.parent for file in manifests}
        return cls(own, _prefixes(named), values)

    def find(self, interface: str) -> str:
        """The text of a definition; KeyError where there is none at hand."""
        package, kind, name = interface.split("/")
        for stem, file in self._files(package, kind):
            if stem == name:
                text = file.read_text(encoding="utf-8", errors="replace")
                return fill_text(text, self.values)
        return feedback_definition(interface, self.find)

    def names(self, package: str, kind: str) -> list[str]:
        """Names of the interfaces of one kind in a package."""
        return sorted({stem for stem, _ in self._files(package, kind)})

    @cached_property
    def packages(self) -> set[str]:
        """Every package with interfaces."""
        packages = set(self.own)
        for prefix in self.prefixes or ():
            index = prefix / "share/ament_index/resource_index/rosidl_interfaces"
            packages |= {file.name for file in index.glob("*")}
        return packages

    def _files(self, package: str, kind: str) -> Iterator[tuple[str, Path]]:
        """Name and file of each interface of a kind, the assignment's own first."""
        folders = [prefix / "share" / package for prefix in self.prefixes or ()]
        if package in self.own:
            folders.insert(0, self.own[package])
        for folder in folders:
            for file in (folder / kind).glob(f"*.{kind}"):
                yield fill_text(file.stem, self.values), file


def _prefixes(underlays: Sequence[Underlay]) -> Sequence[Path] | None:
    """The ament prefixes of underlays and of ROS; None where one of them is not installed."""
    try:
        installation = ros.find()
        if not underlays:
            return installation.prefixes
        from grader.submission.underlay.store import UnderlayStore

        store = UnderlayStore(resources.cache_folder(), installation)
        return [*store.fetched(underlays), *installation.prefixes]
    except GraderFault:
        return None


def write_interfaces(folder: Path, values: Values, target: Path) -> None:
    """Write the packages of an assignment with values in the places of variables."""
    for file in sorted((folder / FOLDER).rglob("*")):
        if file.is_file():
            copy = target / fill_interface(str(file.relative_to(folder / FOLDER)), values)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text(fill_interface(file.read_text("utf-8"), values), "utf-8")


def open_interfaces(assignment: Assignment, folder: Path, values: Values) -> list[str]:
    """The interfaces that only a variable names, and that the author has no copy of."""
    copies = {fill_text(file.parent.name, values) for file in (folder / FOLDER).rglob(_MANIFEST)}
    names = [values[name] for name, one in assignment.variables.items() if one.in_ == "interfaces"]
    return [name for name in names if name.partition("/")[0] not in copies]


def interface_problems(
    source: Source, assignment: Assignment, checks: Sequence[BoundCheck], known: Interfaces
) -> Iterator[Problem]:
    """Find interfaces that are neither in ROS, nor beside the assignment, nor handed in.

    A package of Jazzy that is not installed here, or that the solution ``depends`` on, is not
    judged: it may have the interface.
    """
    handed_in = {package.name for package in assignment.packages}
    left_open = open_interfaces(assignment, source.file.parent, known.values)
    elsewhere = {name for package in assignment.packages for name in package.depends} | PACKAGES
    for place, interface, is_imported in _named(assignment, checks):
        package = interface.split("/")[0]
        if interface in left_open:
            continue
        if package not in handed_in or (is_imported and package in known.packages):
            yield from _unknown(source, place, interface, elsewhere, known)
        elif is_imported:
            text = (
                f"students hand in {package!r}, and rosgrade never imports their code: put your "
                f"own copy of it in {FOLDER}/{package} beside the assignment"
            )
            yield source.problem(place, text)


def _named(
    assignment: Assignment, checks: Sequence[BoundCheck]
) -> Iterator[tuple[Place, str, bool]]:
    """Where interfaces are named, and whether the probe imports them."""
    for index, scenario in enumerate(assignment.scenarios):
        for key, items in (("record", scenario.record), ("stimuli", scenario.stimuli)):
            for number, item in enumerate(items):
                interface = getattr(item, "type", None)
                if isinstance(interface, str):
                    yield ("scenarios", index, key, number, "type"), interface, True
    for index, bound in enumerate(checks):
        for key in ("type", "interface"):
            interface = getattr(bound.parameters, key, None)
            if isinstance(interface, str) and re.fullmatch(INTERFACE, interface):
                yield ("checks", index, "with", key), interface, False


def _unknown(
    source: Source, place: Place, interface: str, elsewhere: set[str], known: Interfaces
) -> Iterator[Problem]:
    package, kind, name = interface.removesuffix(FEEDBACK).split("/")
    names = known.names(package, kind)
    if name in names:
        return
    if package in known.packages:
        where = f"{FOLDER}/{package}" if package in known.own else package
        text = f"{where} has no {kind} {name!r}."
        yield source.problem(place, text + nearest_or_all(name, names, "It has"))
    elif known.prefixes is not None and package not in elsewhere:
        text = (
            f"there is no package {package!r}: not in ROS, not in {FOLDER}/ beside the assignment, "
            "not in 'underlays', and not in 'packages' or their 'depends'."
        )
        yield source.problem(place, text + did_you_mean(package, known.packages))


def field_problems(
    source: Source, assignment: Assignment, checks: Sequence[BoundCheck], known: Interfaces
) -> Iterator[Problem]:
    """Find fields that the messages do not have; where a definition is not at hand, none."""
    for index, bound in enumerate(checks):
        phases = bound.spec.window.phases if bound.spec.window else {}
        for key, parameters in {"with": bound.parameters, **phases}.items():
            for named in parameters.named_fields():
                place = ("checks", index, key, *named.place)
                for interface in _types(assignment, bound, named.endpoint):
                    try:
                        find = part_of(known.find, interface, named.part)
                        message = _sample(interface, find, ())
                    except (KeyError, IndexError):
                        continue
                    lack = _lack(named, message)
                    if lack:
                        yield source.problem(place, f"{named.endpoint} ({interface}): {lack}")


def _types(assignment: Assignment, bound: BoundCheck, endpoint: str) -> list[str]:
    """The types that a topic, a service or an action has in the scenarios of a check."""
    types: dict[str, None] = {}
    for scenario in assignment.judged_by(bound.spec):
        exchanged = dict(one.exchanged for one in scenario.stimuli if one.exchanged)
        type_ = {**exchanged, **scenario.recorded_types}.get(endpoint)
        if type_ is not None:
            types[type_] = None
    return list(types)


def _lack(named: NamedFields, message: dict[str, Any]) -> str:
    """Why a message cannot be as a check expects it, or nothing."""
    try:
        if isinstance(named.fields, str):
            value_at(message, _INDEX.sub("[0]", named.fields))
            return ""
        for path, expected in expected_leaves(named.fields, message).items():
            sample = value_at(message, _INDEX.sub("[0]", path))
            why = unreachable(expected, sample, tolerance_of(named.tolerance, path))
            if why:
                return f"{path} {why}"
    except NoSuchField as error:
        return str(error)
    return ""


def _sample(interface: str, find: Find, around: tuple[str, ...]) -> dict[str, Any]:
    """A message of a type, with one value in each of its arrays."""
    if interface in around:
        raise KeyError(interface)
    message: dict[str, Any] = {}
    for name, field in fields_of(interface, find(interface)).items():
        value = _ZERO.get(field.type, 0)
        if field.is_message:
            value = _sample(field.type, find, (*around, interface))
        message[name] = [value] if field.is_array else value
    return message
