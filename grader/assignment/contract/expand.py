"""An assignment with a contract as an author would write it without one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from grader.assignment.contract.derive import Derivation, StandardCheck
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
    mistakes = [*derivation.problems(), *_misfits(source, derivation)]
    if mistakes:
        problems = [source.problem(place, text) for place, text in mistakes]
        raise AssignmentError(source.file, in_order(problems))
    packages = _in_list("packages", _packages(contract))
    checks = _in_list("checks", _checks(source, derivation))
    authors_checks = source.data.get("checks") or []
    runs = source.data.get("scenarios") or []
    made_in_runs = [_of_run(contract, run) for run in runs]
    data = {
        **source.data,
        "packages": [made.value for made in packages.values()],
        "checks": [*(made.value for made in checks.values()), *authors_checks],
    }
    if runs:
        data["scenarios"] = [
            _with_made(run, made) for run, made in zip(runs, made_in_runs, strict=True)
        ]
    rewriting = Rewriting(source)
    rewriting.begins("packages", _PACKAGES)
    rewriting.begins("checks", (KEY,))
    rewriting.moved_all("checks", authors_checks, by=len(checks))
    for place, made in (packages | checks).items():
        _note(rewriting, place, made)
    for number, made_in_run in enumerate(made_in_runs):
        for key, made in made_in_run.items():
            _note(rewriting, ("scenarios", number, key), made)
    return rewriting.document(data)


def _with_made(run: Any, made: Mapping[str, _Made]) -> Any:
    return {**run, **{key: part.value for key, part in made.items()}} if made else run


def _in_list(key: str, entries: Iterable[_Made]) -> dict[Place, _Made]:
    """Entries of a list, by their places."""
    return {(key, number): entry for number, entry in enumerate(entries)}


def _note(rewriting: Rewriting, place: Place, made: _Made) -> None:
    """Note where a part that is made comes from."""
    if made.origin is None:
        return
    rewriting.made(made.value, made.origin, place)
    for inside, origin in made.closer.items():
        value = made.value
        for step in inside:
            value = value[step]
        rewriting.made(value, origin, (*place, *inside))


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
    keys = dict.fromkeys((*_ORDER, *data))
    return {key: data[key] for key in keys if key in data and key != KEY}


def _misfits(source: Source, derivation: Derivation) -> Iterator[tuple[Place, str]]:
    """What in the rest of the document does not go with the contract."""
    for key in ("checks", "scenarios"):
        if not isinstance(source.data.get(key) or [], list):
            yield (key,), "expected a list: each entry begins with '- '"
    if "packages" in source.data:
        yield ("packages",), "the packages stand in the contract: leave 'packages' out"
    standard_ids = [check.id for check in derivation.judged]
    authors_checks = source.data.get("checks")
    if not isinstance(authors_checks, list):
        return
    for index, entry in enumerate(authors_checks):
        id_ = entry.get("id") if isinstance(entry, dict) else None
        if id_ in standard_ids:
            text = (
                f"{id_!r} comes from the contract already: write what differs under "
                f"'contract: checks: {id_}', or take its points away there"
            )
            yield ("checks", index, "id"), text


def _packages(contract: Contract) -> Iterator[_Made]:
    """The entries of ``packages``."""
    for name, package in contract.packages.items():
        build_types = list(package.build_type)
        entry = {
            "name": name,
            "build_type": build_types if len(build_types) > 1 else build_types[0],
            "depends": list(package.depends),
            "executables": list(package.executables),
        }
        yield _Made({key: value for key, value in entry.items() if value}, (*_PACKAGES, name))


def _checks(source: Source, derivation: Derivation) -> Iterator[_Made]:
    """The standard checks, as entries of ``checks``."""
    for check in derivation.judged:
        entry = derivation.entry(check)
        yield _Made(entry, check.place, dict(_changed(source, check, entry)))


def _changed(
    source: Source, check: StandardCheck, entry: Mapping[str, Any]
) -> Iterator[tuple[Place, Place]]:
    """What of a standard check its author wrote under its id, with where it is written."""
    for key, value in entry.items():
        places: list[Place] = [(key,)]
        if key == "with" and isinstance(value, dict) and value:
            places = [(key, parameter) for parameter in value]
        for place in places:
            origin = (KEY, "checks", check.id, *place)
            if origin in source.lines:
                yield place, origin


def _of_run(contract: Contract, run: Any) -> dict[str, _Made]:
    """What a scenario lacks: by default it runs the only program and records its topics."""
    if not isinstance(run, dict) or "bag" in run:
        return {}
    made = {}
    launched = _launched(contract, run)
    if launched != run.get("launch"):
        made["launch"] = _Made(launched, None if "launch" in run else _PACKAGES)
    entries = launched if isinstance(launched, list) else []
    executables = [entry.get("executable") for entry in entries if isinstance(entry, dict)]
    types: dict[str, str] = {}
    origins: dict[str, Place] = {}
    for (package, name), program in contract.programs.items():
        if name in executables:
            for topic, published in program.publishes.items():
                types[topic] = published.type
                origins[topic] = (*_PACKAGES, package, "executables", name, "publishes", topic)
    if "world" in run:
        types.pop(_command_topic(run), None)
    if "record" not in run and types:
        record = [{"topic": topic, "type": type_} for topic, type_ in types.items()]
        closer: dict[Place, Place] = {
            (number,): origins[topic] for number, topic in enumerate(types)
        }
        made["record"] = _Made(record, _PACKAGES, closer)
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
        {**only, **entry} if isinstance(entry, dict) and _says_no_program(entry) else entry
        for entry in launched
    ]


def _says_no_program(launch: dict[str, Any]) -> bool:
    return "executable" not in launch and "file" not in launch


def _command_topic(scenario: dict[str, Any]) -> str:
    """The topic of the robot's commands, which its world records."""
    command: Any = scenario.get("topics") or {}
    for key in ("command", "topic"):
        command = command.get(key) if isinstance(command, dict) else None
    return command if isinstance(command, str) else Topics().command.topic
