"""The standard mutants: mistakes that follow from what the checks of an assignment ask for.

A rule belongs to a check of the catalogue. It says what is wrong where that check fails, in the
files of a package (:mod:`grader.authoring.mutants.manifest`) or in what a program does
(:mod:`grader.authoring.mutants.misbehaviour`). A mutant loses the checks that a rule was found for.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from grader.assignment.binding import BoundCheck
from grader.assignment.load import LoadedAssignment
from grader.assignment.mutant import Mutant
from grader.assignment.mutant_file import Mutants, load_mutants
from grader.assignment.reference import LANGUAGES, Language, read_files, reference_of
from grader.assignment.selection import required_by
from grader.authoring.mutants import manifest
from grader.authoring.mutants.manifest import Files, PackageFiles
from grader.authoring.mutants.misbehaviour import RULES, RunCheck
from grader.errors import AssignmentError, Problem, UsageError
from grader.run.imposing.mistake import Mistake
from grader.spec.nearest_name import nearest_or_all


@dataclass(frozen=True)
class Standard:
    """A standard mutant: a usual mistake, made from what the contract asks for.

    Attributes:
        mistakes: What a run imposes on the reference; the mutant has no edits then.
    """

    mutant: Mutant
    mistakes: tuple[Mistake, ...] = ()


@dataclass
class _Draft:
    """A mutant that is being found: what is wrong, about what, and which checks lose by it."""

    kind: str
    title: str
    about: tuple[str, ...]
    files: Files = field(default_factory=dict)
    mistakes: tuple[Mistake, ...] = ()
    loses: list[str] = field(default_factory=list)


def with_standard_mutants(loaded: LoadedAssignment, written: Mutants) -> tuple[Standard, ...]:
    """The standard mutants that an assignment has, with what its author says of them.

    Raises:
        AssignmentError: The author wrote a mutant with the id of one.
    """
    if loaded.assignment.contract is None:
        return ()
    standard = standard_mutants(loaded, read_files(written.reference))
    ids = {one.mutant.id for one in standard}
    problems = [
        Problem(f"{one.id!r} is a standard mutant: rename it, or leave that out under `derived`")
        for one in (*written.mutants, *written.variants)
        if one.id in ids and written.derived.get(one.id) is not False
    ]
    if problems:
        raise AssignmentError(written.file, problems)
    kept = []
    for one in standard:
        losses = written.derived.get(one.mutant.id)
        if losses is None:
            kept.append(one)
        elif losses is not False:
            mutant = one.mutant.model_copy(update={"loses": losses.loses})
            kept.append(replace(one, mutant=mutant))
    return tuple(kept)


def every_mutant(loaded: LoadedAssignment) -> list[Mutant]:
    """All mutants of an assignment, in each language that it has a reference for."""
    mutants: list[Mutant] = []
    standard_ids: set[str] = set()
    files_of_derived: dict[str, Path] = {}
    for language in LANGUAGES:
        if not _has_mutants(loaded, language):
            continue
        written = load_mutants(loaded.assignment, loaded.folder, language=language)
        standard = with_standard_mutants(loaded, written)
        mutants += [*written.mutants, *(one.mutant for one in standard)]
        every = standard_mutants(loaded, read_files(written.reference))
        standard_ids |= {one.mutant.id for one in every}
        files_of_derived |= dict.fromkeys(written.derived, written.file)
    unknown = files_of_derived.keys() - standard_ids
    if unknown:
        name = min(unknown)
        advice = nearest_or_all(name, sorted(standard_ids), "The standard mutants are")
        problem = Problem(f"no standard mutant is called {name!r}.{advice}", where="derived")
        raise AssignmentError(files_of_derived[name], [problem])
    return mutants


def _has_mutants(loaded: LoadedAssignment, language: Language) -> bool:
    """Whether there are mutants in a language: in its file, or standard ones of its reference."""
    if (loaded.folder / language.mutants).exists():
        return True
    try:
        reference_of(loaded.assignment.id, loaded.folder, language)
    except UsageError:
        return False
    return loaded.assignment.contract is not None


def standard_mutants(loaded: LoadedAssignment, files: Mapping[str, bytes]) -> tuple[Standard, ...]:
    """All standard mutants of what the contract asks for, for the files of a reference."""
    drafts: dict[tuple[object, ...], _Draft] = {}
    entries = (loaded.source.data.get("checks") if loaded.source else None) or ()
    authors_ids = {entry.get("id") for entry in entries}
    for bound in loaded.checks:
        if bound.spec.id in authors_ids:
            continue
        for draft in (*_in_package(bound, loaded, files), *_in_run(bound, loaded)):
            key = (draft.kind, frozenset(draft.files.items()), draft.mistakes)
            drafts.setdefault(key, draft).loses += draft.loses or [bound.spec.id]
    return tuple(
        Standard(
            Mutant(
                id=name,
                title=draft.title,
                files=dict(draft.files),
                loses=_failing(draft.loses, loaded),
            ),
            draft.mistakes,
        )
        for name, draft in _named(drafts.values())
    )


def _failing(loses: list[str], loaded: LoadedAssignment) -> tuple[str, ...]:
    """Those that fail among the checks that lose; what requires one of them is skipped."""
    requires = {spec.id: spec.requires for spec in loaded.assignment.checks}
    return tuple(
        check
        for check in requires
        if check in loses and not required_by(check, requires).intersection(loses)
    )


def _named(drafts: Iterable[_Draft]) -> Iterator[tuple[str, _Draft]]:
    """An id for each: its kind, and where there are several, as much as is needed of the rest."""
    drafts = list(drafts)
    for draft in drafts:
        same_kind = [other for other in drafts if other.kind == draft.kind]
        columns = [*zip(*(other.about for other in same_kind), strict=True)]
        varied = [column for column in columns if len({*column}) > 1]
        telling = [column for column in varied if len({*column}) == len(same_kind)]
        index = same_kind.index(draft)
        words = [draft.kind, *(column[index].strip("/") for column in telling[:1] or varied)]
        yield re.sub(r"\W+", "_", "_".join(words)).lower(), draft


def _in_package(
    bound: BoundCheck, loaded: LoadedAssignment, files: Mapping[str, bytes]
) -> Iterator[_Draft]:
    changes = [change for change in manifest.CHANGES if bound.spec.uses in change.checks]
    package = _package(bound, loaded, files) if changes else None
    if package is None:
        return
    for change in changes:
        changed_files = change.make(package)
        if changed_files:
            about = (package.name, package.about)
            yield _Draft(change.id, change.title, about, files=changed_files)


def _package(
    bound: BoundCheck, loaded: LoadedAssignment, files: Mapping[str, bytes]
) -> PackageFiles | None:
    """The package of a reference that a check is about, and the part of it that it asks for."""
    parameters: Any = bound.parameters
    about: str = getattr(parameters, "executable", "") or getattr(parameters, "interface", "")
    name: str = getattr(parameters, "package", "") or about.partition("/")[0]
    if bound.spec.uses == "node.starts":
        about = "".join(RunCheck(bound, loaded).programs)
    texts = {path: content.decode("utf-8", "replace") for path, content in files.items()}
    for package in loaded.assignment.packages:
        is_meant = package.name == name if name else about in package.executables
        folder = _folder_of(package.name, texts) if is_meant else None
        if folder is not None:
            for file in ("package.xml", "setup.py"):
                _refuse_broken(f"{folder}{file}", texts.get(f"{folder}{file}", ""))
            return PackageFiles(package.name, texts, package.executables, folder, about)
    return None


def _folder_of(package: str, texts: Mapping[str, str]) -> str | None:
    """Where a package is in a reference, with a slash at the end."""
    tag = re.compile(rf"<name>\s*{re.escape(package)}\s*</name>")
    for path, text in texts.items():
        if path.rpartition("/")[2] == "package.xml" and tag.search(text):
            return path.removesuffix("package.xml")
    return None


def _refuse_broken(path: str, text: str) -> None:
    """Refuse a file of a reference that cannot be read, so that no mistake can be made in it."""
    try:
        if path.endswith(".py"):
            ast.parse(text)
        else:
            ElementTree.fromstring(text)
    except (SyntaxError, ElementTree.ParseError) as error:
        raise AssignmentError(Path("reference", path), [Problem(str(error))]) from error


def _in_run(bound: BoundCheck, loaded: LoadedAssignment) -> Iterator[_Draft]:
    rule = RULES.get(bound.spec.uses or "")
    check = RunCheck(bound, loaded)
    if rule is None or not check.programs:
        return
    for wrong in rule(check):
        mistakes = tuple(
            Mistake(program, *imposed) for program in check.programs for imposed in wrong.imposed
        )
        about = (wrong.about, " ".join(check.programs))
        yield _Draft(wrong.kind, wrong.title, about, mistakes=mistakes, loses=list(wrong.loses))
