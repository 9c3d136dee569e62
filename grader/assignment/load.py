"""Loading an assignment: its YAML, its checks bound to the catalogue, its hash."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from grader import resources
from grader.assignment import expected, interfaces, rules, simulation
from grader.assignment.binding import BoundCheck, bind, tell_apart
from grader.assignment.draft import Draft
from grader.assignment.lesson_checks import lesson_checks
from grader.assignment.model import Assignment, Scenario
from grader.assignment.stimuli import stimulus_rules as stimulation
from grader.assignment.withheld import NOTHING_WITHHELD, Withheld
from grader.checks.catalogue import CATALOGUE
from grader.checks.check import Check, Subject
from grader.errors import AssignmentError, Problem, UsageError
from grader.spec.nearest_name import did_you_mean
from grader.spec.source import Source, read_source

__all__ = [
    "ASSIGNMENT_FILE",
    "BoundCheck",
    "LoadedAssignment",
    "find_assignment",
    "folder_sha256",
    "list_assignments",
    "load_assignment",
]

ASSIGNMENT_FILE = "assignment.yaml"
_TELLING = frozenset({"id", "title", "packages", "checks"})
"""What no other YAML of ours has, and of which no draft has nothing."""


@dataclass(frozen=True)
class LoadedAssignment:
    """An assignment, ready to run and to judge.

    Attributes:
        sha256: Hash over the paths and contents of the files in its folder, as hex.
        checks: One per entry of ``checks``, in the author's order.
    """

    assignment: Assignment
    file: Path
    sha256: str
    checks: tuple[BoundCheck, ...]
    withheld: Withheld = NOTHING_WITHHELD

    @property
    def folder(self) -> Path:
        """Where it lies: worlds, own checks and the handout are beside the YAML."""
        return self.file.parent

    @property
    def location(self) -> str | None:
        """Its absolute path; None for an assignment of rosgrade's own, which its id finds."""
        place = self.folder if self.file.name == ASSIGNMENT_FILE else self.file
        own = place.resolve().parent == resources.assignments().resolve()
        return None if own else str(place.absolute())

    def scenarios_of(self, bound: BoundCheck) -> tuple[Scenario, ...]:
        """The scenarios that a check judges: those that it names, or all.

        A check of the submission itself has none.
        """
        if bound.check.subject is Subject.SUBMISSION:
            return ()
        wanted = bound.spec.scenarios
        return tuple(one for one in self.assignment.scenarios if not wanted or one.id in wanted)


def list_assignments(folder: Path | None = None) -> tuple[str, ...]:
    """Ids of the assignments in a folder, by default rosgrade's own, sorted."""
    folder = resources.assignments() if folder is None else folder
    return tuple(sorted(file.parent.name for file in folder.glob(f"*/{ASSIGNMENT_FILE}")))


def find_assignment(name: str | Path, folder: Path | None = None) -> Path:
    """Find the YAML file of an assignment.

    Args:
        folder: Where ids are looked up, by default rosgrade's own assignments.

    Raises:
        UsageError: There is none, with the nearest id.
    """
    given = Path(name)
    if given.is_file():
        return given
    if (given / ASSIGNMENT_FILE).is_file():
        return given / ASSIGNMENT_FILE
    folder = resources.assignments() if folder is None else folder
    known = list_assignments(folder)
    if str(name) in known:
        return folder / str(name) / ASSIGNMENT_FILE
    if given.is_dir():
        raise UsageError(f"{given}: there is no {ASSIGNMENT_FILE} in it")
    if given.name != str(name) or given.suffix:
        raise UsageError(f"{given}: no such file or folder")
    listed = f" There are: {', '.join(known) or 'none'}."
    raise UsageError(
        f"no assignment {str(name)!r}.{did_you_mean(str(name), known) or listed} "
        f"One of your own is named by its folder, such as path/to/{name}."
    )


def refuse_swapped(name: str, submission: Path) -> None:
    """Help whoever names what was handed in first, and then the assignment.

    Raises:
        UsageError: What stands for the submission is the id of an assignment, and is nothing else.
    """
    known = list_assignments()
    if name not in known and str(submission) in known and not submission.exists():
        raise UsageError(
            f"{submission} is an assignment, and an assignment comes first: {submission} {name}"
        )


def load_assignment(
    name: str | Path, catalogue: Mapping[str, Check] = CATALOGUE, folder: Path | None = None
) -> LoadedAssignment:
    """Load an assignment.

    Args:
        folder: Where ids are looked up, by default rosgrade's own assignments.

    Raises:
        UsageError: There is no such assignment, or it is a file of another kind.
        AssignmentError: With every mistake in it that was found.
    """
    file = find_assignment(name, folder)
    source = read_source(file)
    if file.name != ASSIGNMENT_FILE and _TELLING.isdisjoint(source.data):
        raise UsageError(
            f"{file}: is no assignment: it has no {', '.join(sorted(_TELLING))}. Worlds and "
            f"mutants are read with the {ASSIGNMENT_FILE} that they belong to: name that one"
        )
    assignment, found = source.examine(Assignment)
    try:
        own = lesson_checks(file.parent)
    except ValueError as error:
        raise AssignmentError(file, [*found, source.problem(("checks",), str(error))]) from error
    checks, more = _fit(source, {**catalogue, **own} if own else catalogue)
    found += [problem for problem in more if problem not in found]
    if assignment is not None and not found:
        found += simulation.problems(source, assignment)
        known = interfaces.Interfaces.of(file.parent)
        found += interfaces.problems(source, assignment, checks, known)
        found += stimulation.problems(source, assignment, known)
        found += expected.problems(source, assignment, checks, known)
    if assignment is None or found:
        raise AssignmentError(file, sorted(found, key=lambda problem: problem.line or 0))
    digest = folder_sha256(file.parent) if file.name == ASSIGNMENT_FILE else _sha256(file)
    return LoadedAssignment(assignment, file, digest, tuple(tell_apart(checks)))


def _fit(source: Source, catalogue: Mapping[str, Check]) -> tuple[list[BoundCheck], list[Problem]]:
    """Bind the checks and see whether everything fits together."""
    draft = Draft.of(source)
    found: list[Problem] = []
    bound: list[BoundCheck | None] = []
    for index, spec in enumerate(draft.checks):
        if spec is None:
            bound.append(None)
            continue
        check, problems = bind(source, index, spec, catalogue, source.file.parent)
        bound.append(check)
        found += problems
    found += rules.problems(draft, bound)
    found += _folder_name(source)
    return [check for check in bound if check is not None], found


def _folder_name(source: Source) -> list[Problem]:
    """The id of an assignment is the name of its folder: ids are found by it."""
    folder = source.file.resolve().parent.name
    identity = source.data.get("id")
    if source.file.name != ASSIGNMENT_FILE or not isinstance(identity, str):
        return []
    if identity == folder:
        return []
    return [source.problem(("id",), f"{identity!r} is not the name of its folder, {folder!r}")]


def folder_sha256(folder: Path, besides: Path | None = None) -> str:
    """Hash the paths and contents of all files in a folder, hidden ones and caches left out.

    Raises:
        UsageError: A file cannot be read.
    """
    digest = sha256()
    for file in sorted(folder.rglob("*"), key=lambda path: path.relative_to(folder).as_posix()):
        inside = file.relative_to(folder)
        # Or grading a submission from within an assignment's folder would change the assignment.
        tools = {"__pycache__", "rosgrade-report"}
        ignored = any(part.startswith(".") or part in tools for part in inside.parts)
        if ignored or not file.is_file():
            continue
        if besides is not None and file.is_relative_to(besides):
            continue
        digest.update(os.fsencode(inside.as_posix()) + f"\0{_sha256(file)}\n".encode())
    return digest.hexdigest()


def _sha256(file: Path) -> str:
    try:
        return sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}") from error
