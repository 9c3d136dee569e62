"""An assignment with a contract as an author would write it without one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from grader.assignment.contract.derive import Derivation, Derived
from grader.assignment.contract.model import Contract
from grader.assignment.variable import Values, filled
from grader.errors import AssignmentError
from grader.spec.document import Place
from grader.spec.rewriting import Rewriting
from grader.spec.source import Source, in_order
from sim.description import Topics

KEY = "contract"
_PACKAGES: Place = (KEY, "packages")


@dataclass(frozen=True)
class _Made:
    """A part of the document that stands for a part of the contract.

    Attributes:
        origin: Where the author wrote what it is made from; None for the part that it replaces.
        closer: Parts in it, by their places there, that come from another place.
    """

    value: Any
    origin: Place | None
    closer: Mapping[Place, Place] = field(default_factory=dict)


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
    packages = _in_list("packages", _packages(contract))
    checks = _in_list("checks", _checks(source, derivation))
    runs, authors = (source.data.get(key) or [] for key in ("scenarios", "checks"))
    of_runs = [_of_run(contract, run) for run in runs]
    data = {
        **source.data,
        "packages": [one.value for one in packages.values()],
        "checks": [*(one.value for one in checks.values()), *authors],
    }
    if runs:
        data["scenarios"] = [
            {**run, **{key: one.value for key, one in parts.items()}} if parts else run
            for run, parts in zip(runs, of_runs, strict=True)
        ]
    in_runs: dict[Place, _Made] = {
        ("scenarios", number, key): one
        for number, parts in enumerate(of_runs)
        for key, one in parts.items()
    }
    written = Rewriting(source)
    written.begins("packages", _PACKAGES)
    written.begins("checks", (KEY,))
    written.moved_all("checks", authors, by=len(checks))
    for made in (packages, checks, in_runs):
        for place, one in made.items():
            _note(written, place, one)
    return written.document(data)


def _in_list(key: str, made: Iterable[_Made]) -> dict[Place, _Made]:
    """Entries of a list, by their places."""
    return {(key, number): one for number, one in enumerate(made)}


def _note(written: Rewriting, place: Place, made: _Made) -> None:
    """Note where a part that is made comes from."""
    if made.origin is None:
        return
    written.made(made.value, made.origin, place)
    for inside, origin in made.closer.items():
        value = made.value
        for step in inside:
            value = value[step]
        written.made(value, origin, (*place, *inside))


def expanded_with(source: Source, values: Values) -> Source:
    """The same with values in the places of its variables.

    Two variables may have one value, such as a program that runs both robots. As keys of the
    contract they would be one part of it, and so they are filled in last.
    """
    if len({*values.values()}) < len(values):
        return filled(expanded(source), values)
    return expanded(filled(source, values))


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


def _packages(contract: Contract) -> Iterator[_Made]:
    """The entries of ``packages``."""
    for name, one in contract.packages.items():
        kinds = list(one.build_type)
        entry = {
            "name": name,
            "build_type": kinds if len(kinds) > 1 else kinds[0],
            "depends": list(one.depends),
            "executables": list(one.executables),
        }
        yield _Made({key: value for key, value in entry.items() if value}, (*_PACKAGES, name))


def _checks(source: Source, derivation: Derivation) -> Iterator[_Made]:
    """The standard checks, as entries of ``checks``."""
    for one in derivation.kept:
        entry = derivation.entry(one)
        yield _Made(entry, one.place, dict(_changed(source, one, entry)))


def _changed(
    source: Source, one: Derived, entry: Mapping[str, Any]
) -> Iterator[tuple[Place, Place]]:
    """What of a standard check its author wrote under its id, with where it is written."""
    for key, value in entry.items():
        of_with = value if key == "with" and isinstance(value, dict) else ()
        insides: list[Place] = [(key, name) for name in of_with] or [(key,)]
        for inside in insides:
            origin = (KEY, "checks", one.id, *inside)
            if origin in source.lines:
                yield inside, origin


def _of_run(contract: Contract, run: Any) -> dict[str, _Made]:
    """What a scenario lacks: by default it runs the only program and records its topics."""
    if not isinstance(run, dict) or "bag" in run:
        return {}
    made = {}
    launched = _launched(contract, run)
    if launched != run.get("launch"):
        made["launch"] = _Made(launched, None if "launch" in run else _PACKAGES)
    entries = launched if isinstance(launched, list) else []
    names = [one.get("executable") for one in entries if isinstance(one, dict)]
    topics = {
        topic: (published.type, (*_PACKAGES, package, "executables", name, "publishes", topic))
        for (package, name), program in contract.programs.items()
        if name in names
        for topic, published in program.publishes.items()
    }
    if "world" in run:
        topics.pop(_command_topic(run), None)
    if "record" not in run and topics:
        record = [{"topic": topic, "type": type} for topic, (type, _) in topics.items()]
        origins: dict[Place, Place] = {
            (number,): origin for number, (_, origin) in enumerate(topics.values())
        }
        made["record"] = _Made(record, _PACKAGES, origins)
    return made


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
