"""Loading the mutants of an assignment from ``mutants.yaml`` and ``mutants_cpp.yaml``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypeVar

from grader.assignment.changed_reference import mutate
from grader.assignment.model import Assignment
from grader.assignment.mutant import Change, Edits, Losses, Mutant, MutantFile, Variant
from grader.assignment.reference import PYTHON, Language, read_files, reference_of
from grader.assignment.selection import required_by
from grader.errors import AssignmentError, Problem
from grader.spec.document import Place
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Source, in_order, read_source

_C = TypeVar("_C", bound=Change)


@dataclass(frozen=True)
class Mutants:
    """The mutants and variants of an assignment, all of which apply to its reference.

    Attributes:
        derived: What the author says of standard mutants, by their id.
    """

    file: Path
    reference: Path
    mutants: tuple[Mutant, ...]
    variants: tuple[Variant, ...]
    derived: Mapping[str, Literal[False] | Losses]


def load_mutants(
    assignment: Assignment,
    folder: Path,
    reference: Path | None = None,
    language: Language = PYTHON,
) -> Mutants:
    """Read and check the mutants of an assignment, for :func:`reference_of` by default.

    Those of one language may stand in both files. Where standard mutants follow from a contract,
    there need be no file.
    """
    if reference is None:
        reference = reference_of(assignment.id, folder, language)
    files = read_files(reference)
    mutants = Mutants(folder / language.mutants, reference, (), (), {})
    for file_language in dict.fromkeys((PYTHON, language)):
        file = folder / file_language.mutants
        if file.exists():
            is_default = file_language is language
            reader = _Reader(read_source(file), language, is_default, assignment, files)
            mutants = _joined(mutants, reader.read())
    if not mutants.mutants and assignment.contract is None:
        source = read_source(folder / language.mutants)
        problem = source.problem(("mutants",), "there is no mutant")
        raise AssignmentError(source.file, [problem])
    return mutants


def _joined(first: Mutants, second: Mutants) -> Mutants:
    """The mutants of both files; an id that stands in both is an error."""
    ids = {change.id for change in (*first.mutants, *first.variants)}
    twice = ids & {change.id for change in (*second.mutants, *second.variants)}
    if twice:
        text = f"{', '.join(sorted(twice))} stands in {PYTHON.mutants} as well"
        raise AssignmentError(second.file, [Problem(text)])
    return replace(
        first,
        file=second.file,
        mutants=first.mutants + second.mutants,
        variants=first.variants + second.variants,
        derived={**first.derived, **second.derived},
    )


@dataclass(frozen=True)
class _Reader:
    """Reads one file of mutants for one language.

    ``mutants.yaml`` is read for Python and for C++, ``mutants_cpp.yaml`` only for C++.

    Attributes:
        is_default: Whether entries that name no language are of this one.
        files: The reference in this language.
    """

    source: Source
    language: Language
    is_default: bool
    assignment: Assignment
    files: Mapping[str, bytes]

    def read(self) -> Mutants:
        """The mutants and variants that the file has for the language.

        Raises:
            AssignmentError: An entry does not apply to the reference, or names unknown checks.
        """
        content = self.source.read(MutantFile)
        default_file = getattr(content.file, self.language.key)
        mutants = self._in_language("mutants", content.mutants, default_file)
        variants = self._in_language("variants", content.variants, default_file)
        problems = [
            *self.source.duplicates("id", "mutants", "variants"),
            *_losses(self.source, content, self.assignment),
            *self._said_twice("mutants", content.mutants),
            *self._said_twice("variants", content.variants),
            *self._misfits({**mutants, **variants}),
        ]
        if problems:
            raise AssignmentError(self.source.file, in_order(problems))
        changes = tuple(mutants.values()), tuple(variants.values())
        return Mutants(self.source.file, Path(), *changes, content.derived)

    def _in_language(
        self, key: str, entries: Iterable[_C], default_file: str | None
    ) -> dict[Place, _C]:
        """The entries that are of the language, as they are there, by where their edits stand.

        An entry with ``cpp: {replace: x, with: y}`` becomes ``{replace: x, with: y}`` for C++.
        """
        changes: dict[Place, _C] = {}
        for index, entry in enumerate(entries):
            edits = entry.edits_under(self.language.key)
            names_no_language = entry.python is None and entry.cpp is None
            if edits is not None:
                changes[(key, index, self.language.key)] = _with_edits(entry, edits, default_file)
            elif self.is_default and (entry.has_edits or names_no_language):
                # One that changes nothing at all is read too, so that its author is told.
                changes[key, index] = _with_edits(entry, entry, default_file)
        return changes

    def _said_twice(self, key: str, entries: Iterable[Change]) -> Iterator[Problem]:
        """Entries that say in two places what is different in the language."""
        name = self.language.key
        text = f"has edits of its own and under {name!r}: write them in one place"
        for index, entry in enumerate(entries):
            if self.is_default and entry.has_edits and entry.edits_under(name) is not None:
                yield self.source.problem((key, index), text)

    def _misfits(self, changes: Mapping[Place, Change]) -> Iterator[Problem]:
        for place, change in changes.items():
            for inside, text in mutate(change, self.files)[1]:
                yield self.source.problem((*place, *inside), text)


def _with_edits(change: _C, edits: Edits, default_file: str | None) -> _C:
    """The change with these edits as its own; those that name no file are in the default file."""
    own = {name: getattr(edits, name) for name in Edits.model_fields}
    return change.model_copy(update={**own, "file": edits.file or default_file})


def _losses(source: Source, content: MutantFile, assignment: Assignment) -> Iterator[Problem]:
    requires = {spec.id: spec.requires for spec in assignment.checks}
    losses: dict[Place, tuple[str, ...]] = {
        ("mutants", index, "loses"): mutant.loses for index, mutant in enumerate(content.mutants)
    }
    for name, derived in content.derived.items():
        if derived:
            losses["derived", name, "loses"] = derived.loses
    for place, checks in losses.items():
        for number, check in enumerate(checks):
            if check not in requires:
                advice = nearest_or_all(check, requires, "The checks are")
                text = f"there is no check {check!r}.{advice}"
                yield source.problem((*place, number), text)
            above = sorted(required_by(check, requires) & set(checks))
            if above:
                text = f"{check!r} requires {above[0]!r}, so it is skipped: leave it out"
                yield source.problem((*place, number), text)
