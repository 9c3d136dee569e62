"""An assignment with a contract as an author would write it without one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from grader.assignment.contract.derive import Derivation
from grader.assignment.contract.model import Contract
from grader.errors import AssignmentError
from grader.spec.document import Place, places
from grader.spec.source import Source, in_order
from sim.description import Topics

KEY = "contract"


def expanded(source: Source) -> Source:
    """A document with the packages, checks, launches and records that its contract stands for.

    Raises:
        AssignmentError: The contract is not as it must be, or contradicts the rest.
    """
    if KEY not in source.data:
        return source
    contract, problems = source.examine(Contract, (KEY,))
    if contract is None:
        raise AssignmentError(source.file, problems)
    derivation = Derivation(contract)
    found = [*derivation.problems(), *_misfits(source, derivation)]
    if found:
        problems = [source.problem(place, text) for place, text in found]
        raise AssignmentError(source.file, in_order(problems))
    written = _Written(source)
    packages = [written.package(contract, name) for name in contract.packages]
    authors = source.data.get("checks") or []
    checks = [derivation.entry(one) for one in derivation.kept]
    written.move("checks", len(checks))
    for index, (entry, one) in enumerate(zip(checks, derivation.kept, strict=True)):
        written.stand_for(("checks", index), entry, one.place)
        written.differs(("checks", index), entry, (KEY, "checks", one.id))
    scenarios = [
        written.scenario(contract, index, one)
        for index, one in enumerate(source.data.get("scenarios") or [])
    ]
    data = {**source.data, "packages": packages, "checks": [*checks, *authors]}
    if scenarios:
        data["scenarios"] = scenarios
    return replace(source, data=data, lines=written.lines, origins=written.origins)


_ORDER = ("rosgrade", "id", "title", "variables", "packages")


def plain(source: Source) -> dict[str, Any]:
    """A document with all that its contract stands for, and without the contract."""
    data = expanded(source).data
    names = [*(name for name in _ORDER if name in data), *(n for n in data if n not in _ORDER)]
    return {name: data[name] for name in names if name != KEY}


def _misfits(source: Source, derivation: Derivation) -> Iterator[tuple[Place, str]]:
    """What in the rest of the document does not go with the contract."""
    for key in ("checks", "scenarios"):
        if not isinstance(source.data.get(key) or [], list):
            yield (key,), "expected a list: each entry begins with '- '"
    if "packages" in source.data:
        yield ("packages",), "the packages stand in the contract: leave 'packages' out"
    ids = {one.id for one in derivation.kept}
    authors = source.data.get("checks")
    for index, entry in enumerate(authors if isinstance(authors, list) else ()):
        if isinstance(entry, dict) and isinstance(entry.get("id"), str) and entry["id"] in ids:
            text = (
                f"{entry['id']!r} comes from the contract already: write what differs under "
                f"'contract: checks: {entry['id']}', or take its points away there"
            )
            yield ("checks", index, "id"), text


class _Written:
    """The lines of an expanded document: where the author wrote what a part is made of."""

    _PACKAGES: Place = (KEY, "packages")

    def __init__(self, source: Source) -> None:
        self.source = source
        self.lines = dict(source.lines)
        self.origins = dict(source.origins)

    def stand_for(self, place: Place, value: Any, origin: Place) -> None:
        """Give a part that is made the line of the part of the contract that it comes from."""
        self.origins[place] = origin
        self.lines.update(dict.fromkeys(places(value, place), self.source.line(origin) or 1))

    def differs(self, place: Place, made: dict[str, Any], origin: Place) -> None:
        """Note what of an entry the author wrote under its id."""
        for key, value in made.items():
            if isinstance(value, dict) and key == "with":
                self.differs((*place, key), value, (*origin, key))
            elif (*origin, key) in self.source.lines:
                self.stand_for((*place, key), value, (*origin, key))

    def move(self, key: str, by: int) -> None:
        """Note that the entries of a list have come to stand further down."""
        entries = {place: line for place, line in self.lines.items() if place[:1] == (key,)}
        self.lines = {place: line for place, line in self.lines.items() if place not in entries}
        self.lines[key,] = entries.pop((key,), self.source.line((KEY,)) or 1)
        self.origins = {to: written for to, written in self.origins.items() if to[0] != key}
        for place, line in entries.items():
            moved = (key, int(place[1]) + by, *place[2:])
            self.lines[moved] = line
            self.origins[moved] = self.source.written(place)

    def package(self, contract: Contract, name: str) -> dict[str, Any]:
        """The entry of ``packages``."""
        one = contract.packages[name]
        kinds = list(one.build_type)
        entry = {
            "name": name,
            "build_type": kinds if len(kinds) > 1 else kinds[0],
            "depends": list(one.depends),
            "executables": list(one.executables),
        }
        entry = {name: value for name, value in entry.items() if value}
        place: Place = ("packages", list(contract.packages).index(name))
        self.lines.setdefault(("packages",), self.source.line((KEY, "packages")) or 1)
        self.stand_for(place, entry, (KEY, "packages", name))
        return entry

    def scenario(self, contract: Contract, index: int, entry: Any) -> Any:
        """A scenario; by default it runs the only program and records its topics."""
        if not isinstance(entry, dict):
            return entry
        programs = contract.programs
        place: Place = ("scenarios", index)
        made: dict[str, Any] = {}
        launched = _launched(contract, entry)
        if launched != entry.get("launch"):
            made["launch"] = launched
            if "launch" not in entry:
                self.stand_for((*place, "launch"), launched, self._PACKAGES)
        launched = launched if isinstance(launched, list) else []
        names = [one.get("executable") for one in launched if isinstance(one, dict)]
        topics = {
            topic: (published.type, (*self._PACKAGES, package, "executables", name))
            for (package, name), program in programs.items()
            if name in names
            for topic, published in program.publishes.items()
        }
        if "world" in entry:
            topics.pop(_command_topic(entry), None)
        if "record" not in entry and topics:
            made["record"] = [
                {"topic": topic, "type": type_} for topic, (type_, _) in topics.items()
            ]
            self.stand_for((*place, "record"), made["record"], self._PACKAGES)
            for number, (topic, (_, program_place)) in enumerate(topics.items()):
                record = (*place, "record", number)
                origin = (*program_place, "publishes", topic)
                self.stand_for(record, made["record"][number], origin)
        return {**entry, **made}


def _launched(contract: Contract, scenario: dict[str, Any]) -> Any:
    """What a scenario launches: where it does not say which program, the only one."""
    launched = scenario.get("launch", [{}])
    if len(contract.programs) != 1 or not isinstance(launched, list):
        return scenario.get("launch")
    ((package, executable),) = contract.programs
    only = {"executable": executable}
    if len(contract.packages) > 1:
        only["package"] = package
    return [
        {**only, **one} if isinstance(one, dict) and not {"executable", "file"} & {*one} else one
        for one in launched
    ]


def _command_topic(scenario: dict[str, Any]) -> str:
    """The topic of the robot's commands, which its world records."""
    command: Any = scenario.get("topics") or {}
    for key in ("command", "topic"):
        command = command.get(key) if isinstance(command, dict) else None
    return command if isinstance(command, str) else Topics().command.topic
