"""Mutants on disk: reading ``mutants.yaml``, making a mutated submission of the reference."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from grader import resources
from grader.assignment.model import Assignment
from grader.assignment.mutant import Change, Mutant, MutantFile, Variant, mutate, required_by
from grader.errors import AssignmentError, Problem, UsageError
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Source, in_order, read_source

MUTANTS_FILE = "mutants.yaml"
REFERENCE_FOLDER = "reference"
"""Beside assignment.yaml, where the assignment is not one of rosgrade's own."""

_LEFT_OUT = {"__pycache__", "build", "install", "log"}


@dataclass(frozen=True)
class Mutants:
    """The mutants and variants of an assignment, all of which apply to its reference."""

    file: Path
    reference: Path
    mutants: tuple[Mutant, ...]
    variants: tuple[Variant, ...]


def reference_of(assignment: str, folder: Path | None = None) -> Path:
    """The folder of an assignment's reference solution.

    Args:
        folder: Of the assignment.
    """
    beside = folder / REFERENCE_FOLDER if folder is not None else None
    if beside is not None and beside.is_dir():
        return beside
    own = resources.reference() / assignment
    if not own.is_dir():
        places = f"{beside} or {own}" if beside else f"{own}"
        raise UsageError(f"the assignment {assignment!r} has no reference solution: {places}")
    return own


def load_mutants(assignment: Assignment, folder: Path, reference: Path | None = None) -> Mutants:
    """Read and check the mutants of an assignment.

    Args:
        reference: Folder of the reference solution, by default the one in the assignment's
            folder or rosgrade's own.
    """
    reference = reference_of(assignment.id, folder) if reference is None else reference
    source = read_source(folder / MUTANTS_FILE)
    content = source.read(MutantFile)
    files = _read(reference)
    problems = [*source.duplicates("id", "mutants", "variants")]
    problems += _losses(source, content, assignment)
    for key, changes in (("mutants", content.mutants), ("variants", content.variants)):
        for index, change in enumerate(changes):
            _, found = mutate(change, files)
            problems += [source.problem((key, index, *inside), text) for inside, text in found]
    if problems:
        raise AssignmentError(source.file, in_order(problems))
    return Mutants(source.file, reference, content.mutants, content.variants)


def apply(change: Change, reference: Path, target: Path) -> None:
    """Write a changed copy of the reference.

    Args:
        target: Folder to write; it may exist, but must be empty.
    """
    files, found = mutate(change, _read(reference))
    if found:
        raise AssignmentError(
            reference, [Problem(f"{change.id!r} does not apply: {text}") for _, text in found]
        )
    target.mkdir(parents=True, exist_ok=True)
    if any(target.iterdir()):
        raise UsageError(f"{target}: is not empty")
    for name, content in files.items():
        file = target / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)


def _read(folder: Path) -> dict[str, bytes]:
    """All files of a folder by path, without what a build leaves."""
    return {
        inside.as_posix(): (folder / inside).read_bytes()
        for inside in sorted(file.relative_to(folder) for file in folder.rglob("*"))
        if (folder / inside).is_file() and not _LEFT_OUT.intersection(inside.parts)
    }


def _losses(source: Source, content: MutantFile, assignment: Assignment) -> Iterator[Problem]:
    requires = {spec.id: spec.requires for spec in assignment.checks}
    for index, mutant in enumerate(content.mutants):
        for number, lost in enumerate(mutant.loses):
            place = ("mutants", index, "loses", number)
            if lost not in requires:
                advice = nearest_or_all(lost, requires, "The checks are")
                yield source.problem(place, f"there is no check {lost!r}.{advice}")
            above = sorted(required_by(lost, requires) & set(mutant.loses))
            if above:
                text = f"{lost!r} requires {above[0]!r}, so it is skipped: leave it out"
                yield source.problem(place, text)
