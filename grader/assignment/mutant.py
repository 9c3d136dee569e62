"""``mutants.yaml``: what the checks of an assignment must notice, and what they must not.

An entry says under ``python`` and ``cpp`` what is different in the reference in each language.
``mutants_cpp.yaml`` holds what there is only for C++.

A mutant is the reference with one mistake of a student in it, and names the checks that must
fail for it. A variant is another right solution, in an unusual style, and must keep every
point.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from grader.assignment.model import Assignment
from grader.errors import AssignmentError, Problem, UsageError
from grader.findings.finding import Status
from grader.machine import resources
from grader.recording.bag_writer import read_bag, write_bag
from grader.recording.model import NS
from grader.spec.document import Place
from grader.spec.name import Id, TopicName
from grader.spec.nearest_name import nearest_or_all
from grader.spec.quantity import Duration
from grader.spec.source import Model, Source, in_order, read_source


@dataclass(frozen=True)
class Language:
    """Where the solution in one language and its mutants lie.

    Attributes:
        key: What an entry of mutants.yaml calls it.
        mutants: Name of the file beside assignment.yaml.
        reference: Name of the folder beside assignment.yaml.
        own: The folder in ``reference/`` with the solutions of rosgrade's own assignments.
    """

    key: Literal["python", "cpp"]
    mutants: str
    reference: str
    own: str


PYTHON = Language("python", "mutants.yaml", "reference", ".")
CPP = Language("cpp", "mutants_cpp.yaml", "reference_cpp", "cpp")
LANGUAGES = (PYTHON, CPP)

_LEFT_OUT = {"__pycache__", "build", "install", "log"}


def _inside(text: str) -> str:
    """A path that stays in the folder it is relative to."""
    path = PurePosixPath(text)
    if path.is_absolute() or ".." in path.parts or not path.parts or str(path) != text:
        raise ValueError(f"{text!r} is not a path in the reference, such as 'package/setup.py'")
    return text


FilePath = Annotated[str, AfterValidator(_inside)]


class _Place(Model):
    """Where texts are replaced."""

    file: FilePath | None = Field(
        None,
        description="Path in the reference, with forward slashes; by default the `file` of all.",
    )
    count: int = Field(1, ge=1, description="How often the text occurs in the file.")


class Edit(_Place):
    """A text to replace in one file of the reference."""

    replace: str = Field(
        min_length=1, description="The text in the file; it occurs exactly `count` times."
    )
    with_: str = Field(alias="with", description="The new text.")


class BagEdit(Model):
    """What is different in a bag of the reference."""

    folder: FilePath = Field(description="Its folder in the reference.")
    without: tuple[TopicName, ...] = Field((), description="Topics that are not in it.")
    rename: dict[TopicName, TopicName] = Field(
        default_factory=dict, description="Topics that have another name in it."
    )
    since: Duration | None = Field(None, description="The recording begins so much later.")
    until: Duration | None = Field(None, description="The recording ends so long after its start.")
    every: dict[TopicName, int] = Field(
        default_factory=dict,
        description="Topic -> n: only each nth of its messages is in it.",
    )
    storage: Literal["mcap", "sqlite3"] = Field("mcap", description="How it is stored.")


class Edits(_Place):
    """What is different from the reference: `edits` first, then `files`, `move` and `bag`."""

    replace: str | None = Field(
        None, min_length=1, description="Where there is one edit only: the text in the file."
    )
    with_: str | None = Field(None, alias="with", description="The new text of that edit.")
    edits: tuple[Edit, ...] = Field((), description="Texts to replace, one after the other.")
    files: dict[FilePath, str | None] = Field(
        default_factory=dict,
        description="Whole files: path -> content; null deletes the file, or the folder.",
    )
    move: dict[FilePath, FilePath] = Field(
        default_factory=dict, description="Files or folders to move: from -> to."
    )

    bag: BagEdit | None = Field(None, description="What is different in a bag.")

    @model_validator(mode="after")
    def _belong_together(self) -> Edits:
        if (self.replace is None) != (self.with_ is None):
            raise ValueError("`replace` and `with` belong together")
        return self

    @property
    def has_edits(self) -> bool:
        """Whether anything is different by it."""
        return bool(self.edits or self.files or self.move or self.replace or self.bag)

    def every_edit(self, file: str | None = None) -> Iterator[tuple[Place, Edit]]:
        """Its edits, and where they stand in it; those that name no file are in the given one."""
        placed: list[tuple[Place, Edit]] = []
        if self.replace is not None:
            single = self.model_dump(include={"file", "count", "replace"}) | {"with": self.with_}
            placed.append(((), Edit.model_validate(single)))
        placed += [(("edits", index), edit) for index, edit in enumerate(self.edits)]
        for place, edit in placed:
            yield place, edit.model_copy(update={"file": edit.file or self.file or file})


class Change(Edits):
    """What is different from the reference of the file's language, or of each language."""

    id: Id = Field(description="Short name, unique in the file.")
    title: str = Field(description="What is different, in plain words.")
    python: Edits | None = Field(None, description="What is different in the Python reference.")
    cpp: Edits | None = Field(None, description="What is different in the C++ reference.")
    skip_reason: str = Field(
        "", description="Why `rosgrade selftest` skips it; by default it does not."
    )


class Mutant(Change):
    """The reference with one mistake in it."""

    loses: tuple[Id, ...] = Field(
        min_length=1,
        description="Checks that must fail. Those that require them are skipped; all others "
        "must pass.",
    )


class Variant(Change):
    """A correct solution in another style; every check must pass."""


class Files(Model):
    """A file of each reference."""

    python: FilePath | None = Field(None, description="Path in the reference in Python.")
    cpp: FilePath | None = Field(None, description="Path in the reference in C++.")


class Losses(Model):
    """What a standard mutant loses in this assignment."""

    loses: tuple[Id, ...] = Field(min_length=1, description="Checks that must fail.")


class MutantFile(Model):
    """The mutants and variants of an assignment: `assignments/<id>/mutants.yaml`.

    `mutants_cpp.yaml` is the same for what there is only for the reference in C++.
    """

    rosgrade: Literal[1] = Field(description="Version of this format.")
    file: Files = Field(default_factory=Files, description="Where edits are that name no file.")
    derived: dict[Id, Literal[False] | Losses] = Field(
        default_factory=dict,
        description="Standard mutants that lose other checks than follow from the contract, or "
        "`false` for one that is left out.",
    )
    mutants: tuple[Mutant, ...] = Field((), description="Mistakes.")
    variants: tuple[Variant, ...] = Field((), description="Correct solutions in another style.")


def mutate(
    change: Edits, files: Mapping[str, bytes], file: str | None = None
) -> tuple[dict[str, bytes], list[tuple[Place, str]]]:
    """Change the files of a reference: the new files, and what does not apply.

    Args:
        file: Where edits are that name no file.
    """
    changed = dict(files)
    problems = [
        *_replace_texts(change, changed, file),
        *_write_files(change, changed),
        *_move_files(change, changed),
        *_edit_bag(change, changed),
    ]
    if not problems and changed == dict(files):
        problems.append(((), "changes nothing"))
    return changed, problems


def _replace_texts(
    change: Edits, files: dict[str, bytes], file: str | None
) -> Iterator[tuple[Place, str]]:
    for place, edit in change.every_edit(file):
        old, new = edit.replace.encode(), edit.with_.encode()
        if edit.file is None:
            yield place, "says no `file`, and there is none for all edits"
        elif edit.file not in files:
            yield (*place, "file"), f"the reference has no file {edit.file!r}"
        elif files[edit.file].count(old) != edit.count:
            times = files[edit.file].count(old)
            text = f"the text occurs {times} times in {edit.file}, not {edit.count}"
            yield (*place, "replace"), text
        else:
            files[edit.file] = files[edit.file].replace(old, new)


def _write_files(change: Edits, files: dict[str, bytes]) -> Iterator[tuple[Place, str]]:
    for name, content in change.files.items():
        if content is not None:
            files[name] = content.encode()
        elif not _take(name, files):
            yield ("files", name), f"nothing to delete: the reference has no {name!r}"


def _move_files(change: Edits, files: dict[str, bytes]) -> Iterator[tuple[Place, str]]:
    for source, target in change.move.items():
        moved = _take(source, files)
        if not moved:
            yield ("move", source), f"nothing to move: the reference has no {source!r}"
        for path, content in moved.items():
            files[target + path.removeprefix(source)] = content


def _edit_bag(change: Edits, files: dict[str, bytes]) -> Iterator[tuple[Place, str]]:
    if change.bag is None:
        return
    bag = _take(change.bag.folder, files)
    if bag:
        files.update(_edited_bag(change.bag, bag))
    else:
        yield ("bag", "folder"), f"the reference has no folder {change.bag.folder!r}"


def _edited_bag(edit: BagEdit, files: Mapping[str, bytes]) -> dict[str, bytes]:
    """The files of a bag that is written anew."""
    with TemporaryDirectory() as scratch:
        before, after = Path(scratch, "before"), Path(scratch, "after")
        for path, content in files.items():
            file = before / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        messages, definitions = read_bag(before / edit.folder)
        begin_ns = min(message.recorded_ns for message in messages)
        first_ns = begin_ns + (edit.since or 0.0) * NS
        last_ns = math.inf if edit.until is None else begin_ns + edit.until * NS
        counts: Counter[str] = Counter()
        kept = []
        for message in messages:
            topic = message.channel.name
            counts[topic] += 1
            is_skipped = topic in edit.without or counts[topic] % edit.every.get(topic, 1) != 0
            if first_ns <= message.recorded_ns <= last_ns and not is_skipped:
                channel = replace(message.channel, name=edit.rename.get(topic, topic))
                kept.append(replace(message, channel=channel))
        (after / edit.folder).parent.mkdir(parents=True, exist_ok=True)
        write_bag(after / edit.folder, kept, definitions, edit.storage)
        return read_files(after)


def _take(name: str, files: dict[str, bytes]) -> dict[str, bytes]:
    """Take out the file of that name, or all in the folder of that name."""
    paths = [path for path in files if path == name or path.startswith(f"{name}/")]
    return {path: files.pop(path) for path in paths}


def expected_statuses(
    assignment: Assignment, change: Change, put_right: Collection[str] = ()
) -> dict[str, Status]:
    """How each check must end for a mutant or a variant, by its id, in the author's order.

    Args:
        put_right: Checks that fail by a wrong name which the runs put right: nothing that
            requires them is skipped.
    """
    lost = set(change.loses if isinstance(change, Mutant) else ())
    stopping = lost.difference(put_right)
    requires = {spec.id: spec.requires for spec in assignment.checks}
    statuses = {}
    for check in requires:
        if required_by(check, requires) & stopping:
            statuses[check] = Status.SKIPPED
        else:
            statuses[check] = Status.FAILED if check in lost else Status.PASSED
    return statuses


def required_by(check: str, requires: Mapping[str, tuple[str, ...]]) -> set[str]:
    """Everything that a check requires, directly or not; without itself."""
    required: set[str] = set()
    waiting = list(requires.get(check, ()))
    while waiting:
        name = waiting.pop()
        if name not in required:
            required.add(name)
            waiting.extend(requires.get(name, ()))
    return required - {check}


def deviations(expected: Mapping[str, Status], actual: Mapping[str, Status]) -> dict[str, str]:
    """Checks that ended otherwise than they must, each with ``passed instead of failed``."""
    ended = {check: actual[check].value if check in actual else "no result" for check in expected}
    return {
        check: f"{ended[check]} instead of {status.value}"
        for check, status in expected.items()
        if ended[check] != status.value
    }


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


def reference_of(assignment: str, folder: Path | None = None, language: Language = PYTHON) -> Path:
    """The folder of an assignment's reference solution: beside it, or rosgrade's own."""
    places = [resources.reference() / language.own / assignment]
    if folder is not None:
        places.insert(0, folder / language.reference)
    for place in places:
        if place.is_dir():
            return place
    listed = " or ".join(map(str, places))
    is_own = folder is None or folder.is_relative_to(resources.root())
    lacks_solutions = is_own and not resources.reference().is_dir()
    advice = "; install rosgrade-solutions" if lacks_solutions else ""
    raise UsageError(f"the assignment {assignment!r} has no reference solution: {listed}{advice}")


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
    loaded = Mutants(folder / language.mutants, reference, (), (), {})
    for written in dict.fromkeys((PYTHON, language)):
        if (folder / written.mutants).exists():
            loaded = _joined(loaded, _read_mutants(folder, written, language, assignment, files))
    if not loaded.mutants and not has_standard_mutants(assignment):
        source = read_source(folder / language.mutants)
        problem = source.problem(("mutants",), "there is no mutant")
        raise AssignmentError(source.file, [problem])
    return loaded


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


def has_standard_mutants(assignment: Assignment) -> bool:
    """Whether mutants follow from the assignment."""
    return assignment.contract is not None


def _read_mutants(
    folder: Path,
    written: Language,
    language: Language,
    assignment: Assignment,
    files: Mapping[str, bytes],
) -> Mutants:
    """What one file has for a language; ``written`` is the language of the file itself."""
    source = read_source(folder / written.mutants)
    content = source.read(MutantFile)
    default_file = getattr(content.file, language.key)
    problems = [*source.duplicates("id", "mutants", "variants")]
    problems += _losses(source, content, assignment)
    changes: dict[str, list[Any]] = {"mutants": [], "variants": []}
    for key, entries in (("mutants", content.mutants), ("variants", content.variants)):
        for index, entry in enumerate(entries):
            edits, inside = _edits_of(entry, language, is_own=written is language)
            if edits is None:
                continue
            place: Place = (key, index, *inside)
            if edits is not entry and written is language and entry.has_edits:
                text = f"has edits of its own and under {language.key!r}: write them in one place"
                problems.append(source.problem((key, index), text))
            _, misfits = mutate(edits, files, default_file)
            problems += [source.problem((*place, *below), text) for below, text in misfits]
            changes[key].append(_with_edits(entry, edits, default_file))
    if problems:
        raise AssignmentError(source.file, in_order(problems))
    mutants, variants = map(tuple, changes.values())
    return Mutants(source.file, Path(), mutants, variants, content.derived)


def _edits_of(
    change: Change, language: Language, *, is_own: bool
) -> tuple[Edits | None, tuple[str, ...]]:
    """What a change is in a language, and where that stands in it; None if it is none there."""
    edits = getattr(change, language.key)
    if edits is not None:
        return edits, (language.key,)
    is_of_other = change.python is not None or change.cpp is not None
    # Where nothing is changed at all, that is a problem of the file's own language.
    if is_own and (change.has_edits or not is_of_other):
        return change, ()
    return None, ()


def _with_edits(change: Change, edits: Edits, default_file: str | None) -> Change:
    """The change as it is in one language, each of its edits with its file."""
    listed = tuple(edit for _, edit in edits.every_edit(default_file))
    others = {key: getattr(edits, key) for key in ("files", "move", "bag")}
    return change.model_copy(update={"edits": listed, "replace": None, **others})


def apply(change: Change, reference: Path, target: Path) -> None:
    """Write a changed copy of the reference into an empty folder."""
    files, misfits = mutate(change, read_files(reference))
    if misfits:
        problems = [Problem(f"{change.id!r} does not apply: {text}") for _, text in misfits]
        raise AssignmentError(reference, problems)
    for name, content in files.items():
        file = target / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)


def read_files(folder: Path) -> dict[str, bytes]:
    """All files of a folder by path, without what a build leaves."""
    return {
        inside.as_posix(): (folder / inside).read_bytes()
        for inside in sorted(file.relative_to(folder) for file in folder.rglob("*"))
        if (folder / inside).is_file() and not _LEFT_OUT.intersection(inside.parts)
    }


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
