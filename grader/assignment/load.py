"""Loading an assignment: its YAML, its checks bound to the catalogue, its hash."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

from grader.assignment import rules, simulation
from grader.assignment.binding import BoundCheck, bind
from grader.assignment.contract.expand import expanded, expanded_with
from grader.assignment.group import ungrouped
from grader.assignment.interfaces import Interfaces, field_problems, interface_problems
from grader.assignment.lesson_checks import lesson_checks
from grader.assignment.model import NOTHING_WITHHELD, Assignment, Scenario, Withheld
from grader.assignment.repeat import with_runs
from grader.assignment.variable import Values, read_variables
from grader.checks.catalogue import CATALOGUE
from grader.checks.check import Check, Subject
from grader.errors import AssignmentError, Problem, UsageError
from grader.machine import resources
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Source, in_order, read_source
from grader.submission.underlay.definition import find_underlay

ASSIGNMENT_FILE = "assignment.yaml"


@dataclass(frozen=True)
class LoadedAssignment:
    """An assignment, ready to run and to judge.

    Attributes:
        sha256: Hash over the paths and contents of the files in its folder, as hex.
        checks: One per entry of ``checks``, in the author's order.
        values: What stands in it for each variable: the author's examples at first.
        source: The YAML as it is written, with the variables in it, and without groups.
        given: Values from outside for every submission.
    """

    assignment: Assignment
    file: Path
    sha256: str
    checks: tuple[BoundCheck, ...]
    withheld: Withheld = NOTHING_WITHHELD
    values: Values = field(default_factory=dict)
    source: Source | None = field(default=None, repr=False, compare=False)
    given: Values = field(default_factory=dict)

    @property
    def folder(self) -> Path:
        """The folder of the YAML, with worlds, own checks and the handout."""
        return self.file.parent

    @property
    def location(self) -> str | None:
        """Its absolute path; None for an assignment of rosgrade's own, which its id finds."""
        place = self.folder if self.file.name == ASSIGNMENT_FILE else self.file
        own = place.resolve().parent == resources.assignments().resolve()
        return None if own else str(place.absolute())

    @cached_property
    def entries(self) -> dict[str, Any]:
        """The checks as they are written, with the variables in them, by their id."""
        written = expanded(self.source).data["checks"] if self.source else ()
        return {entry["id"]: entry for entry in written}

    def scenarios_of(self, bound: BoundCheck) -> tuple[Scenario, ...]:
        """The scenarios that a check of a run judges: those that it names, or all."""
        if bound.check.subject is Subject.SUBMISSION:
            return ()
        return self.assignment.judged_by(bound.spec)


def list_assignments() -> tuple[str, ...]:
    """Ids of rosgrade's own assignments, sorted."""
    files = resources.assignments().glob(f"*/{ASSIGNMENT_FILE}")
    return tuple(sorted(file.parent.name for file in files))


def find_assignment(name: str | Path) -> Path:
    """Find the YAML file of an assignment by its id, its folder, or itself."""
    path = Path(name)
    if path.is_file():
        return path
    if (path / ASSIGNMENT_FILE).is_file():
        return path / ASSIGNMENT_FILE
    own_ids = list_assignments()
    if str(name) in own_ids:
        return resources.assignments() / str(name) / ASSIGNMENT_FILE
    if path.is_dir():
        raise UsageError(f"{path}: there is no {ASSIGNMENT_FILE} in it")
    if path.name != str(name) or path.suffix:
        raise UsageError(f"{path}: no such file or folder")
    raise UsageError(
        f"no assignment {str(name)!r}.{nearest_or_all(str(name), own_ids)} "
        f"For your own assignment give its folder, such as path/to/{name}."
    )


def load_assignment(
    name: str | Path, catalogue: Mapping[str, Check] = CATALOGUE
) -> LoadedAssignment:
    """Load an assignment.

    Mistakes in its form are reported first; without any, what does not fit together.
    """
    file = find_assignment(name)
    written = ungrouped(read_source(file))
    examples = {name: str(one.example) for name, one in read_variables(written).items()}
    # A place that takes no variable is found here, and not when a submission is judged.
    expanded(written)
    source = expanded_with(written, examples)
    assignment, tried, problems = bound_checks(source, catalogue)
    problems += rules.problems(source, assignment, tried)
    problems += _outside_problems(source, assignment)
    checks = tuple(check for check in tried if check is not None)
    if not problems:
        interfaces = Interfaces.of(file.parent, examples, assignment.underlays)
        problems += simulation.problems(source, assignment, interfaces)
        problems += interface_problems(source, assignment, checks, interfaces)
        problems += field_problems(source, assignment, checks, interfaces)
    if problems:
        raise AssignmentError(file, in_order(problems))
    digest = folder_sha256(file.parent) if file.name == ASSIGNMENT_FILE else _sha256(file)
    assignment, checks = with_runs(assignment, checks)
    return LoadedAssignment(
        assignment, file, digest, checks, assignment.withheld, values=examples, source=written
    )


def _outside_problems(source: Source, assignment: Assignment) -> Iterator[Problem]:
    """What does not fit to the folder that the file is in, or to the underlays of this machine."""
    for number, underlay in enumerate(assignment.underlays):
        try:
            find_underlay(underlay, source.file.parent)
        except UsageError as error:
            yield source.problem(("underlays", number), str(error))
    folder = source.file.resolve().parent.name
    if source.file.name == ASSIGNMENT_FILE and assignment.id != folder:
        text = f"{assignment.id!r} is not the name of its folder, {folder!r}"
        yield source.problem(("id",), text)


def bound_checks(
    source: Source, catalogue: Mapping[str, Check] = CATALOGUE
) -> tuple[Assignment, list[BoundCheck | None], list[Problem]]:
    """Read an assignment and its checks, with what is wrong in them; None for such a check."""
    assignment = simulation.with_turtles(source.read(Assignment), source.file.parent)
    try:
        catalogue = {**catalogue, **lesson_checks(source.file.parent)}
    except ValueError as error:
        problem = source.problem(("checks",), str(error))
        raise AssignmentError(source.file, [problem]) from error
    checks, problems = [], []
    for index, spec in enumerate(assignment.checks):
        check, mistakes = bind(source, index, spec, catalogue)
        checks.append(check)
        problems += mistakes
    return assignment, checks, problems


def folder_sha256(folder: Path, besides: Path | None = None) -> str:
    """Hash the paths and contents of all files in a folder, hidden ones and caches left out."""
    digest = sha256()
    files: dict[str, Path] = {}
    for root, folders, names in os.walk(folder):
        here = Path(root)
        # os.walk goes not into what is left out: a grading writes there meanwhile.
        folders[:] = [name for name in folders if not _is_left_out(name) and here / name != besides]
        for name in names:
            file = here / name
            if not _is_left_out(name) and file.is_file():
                files[file.relative_to(folder).as_posix()] = file
    for inside in sorted(files):
        digest.update(os.fsencode(inside) + f"\0{_sha256(files[inside])}\n".encode())
    return digest.hexdigest()


def _is_left_out(name: str) -> bool:
    """Hidden files, caches, and reports: else grading in the folder would change its hash."""
    return name.startswith(".") or name in {"__pycache__", "rosgrade-report"}


def _sha256(file: Path) -> str:
    try:
        return sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}") from error
