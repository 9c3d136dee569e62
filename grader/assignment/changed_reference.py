"""The reference with what is different in a mutant or a variant."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from grader.assignment.mutant import BagEdit, Change, Edits
from grader.assignment.reference import read_files
from grader.errors import AssignmentError, Problem
from grader.recording.bag import BagMessage
from grader.recording.bag_writer import read_bag, write_bag
from grader.recording.model import NS
from grader.spec.document import Place


def apply(change: Change, reference: Path, target: Path) -> None:
    """Write a changed copy of the reference into an empty folder."""
    files, misfits = mutate(change, read_files(reference))
    if misfits:
        problems = [Problem(f"{change.id!r} does not apply: {text}") for _, text in misfits]
        raise AssignmentError(reference, problems)
    _write_files(files, target)


def mutate(
    change: Edits, files: Mapping[str, bytes]
) -> tuple[dict[str, bytes], list[tuple[Place, str]]]:
    """Change the files of a reference: the new files, and what does not apply."""
    changed = dict(files)
    problems = [
        *_replace_texts(change, changed),
        *_replace_files(change, changed),
        *_move_files(change, changed),
        *_edit_bag(change, changed),
    ]
    if not problems and changed == dict(files):
        problems.append(((), "changes nothing"))
    return changed, problems


def _replace_texts(change: Edits, files: dict[str, bytes]) -> Iterator[tuple[Place, str]]:
    for place, edit in change.placed_edits().items():
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


def _replace_files(change: Edits, files: dict[str, bytes]) -> Iterator[tuple[Place, str]]:
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
        _write_files(files, before)
        messages, definitions = read_bag(before / edit.folder)
        edited = list(_edited_messages(edit, messages))
        (after / edit.folder).parent.mkdir(parents=True, exist_ok=True)
        write_bag(after / edit.folder, edited, definitions, edit.storage)
        return read_files(after)


def _edited_messages(edit: BagEdit, messages: Sequence[BagMessage]) -> Iterator[BagMessage]:
    """The messages that stay in a bag, on the topics that they have there."""
    begin_ns = min(message.recorded_ns for message in messages)
    first_ns = begin_ns + (edit.since or 0.0) * NS
    last_ns = math.inf if edit.until is None else begin_ns + edit.until * NS
    counts: Counter[str] = Counter()
    for message in messages:
        topic = message.channel.name
        counts[topic] += 1
        is_skipped = topic in edit.without or counts[topic] % edit.every.get(topic, 1) != 0
        if first_ns <= message.recorded_ns <= last_ns and not is_skipped:
            channel = replace(message.channel, name=edit.rename.get(topic, topic))
            yield replace(message, channel=channel)


def _take(name: str, files: dict[str, bytes]) -> dict[str, bytes]:
    """Take out the file of that name, or all in the folder of that name."""
    paths = [path for path in files if path == name or path.startswith(f"{name}/")]
    return {path: files.pop(path) for path in paths}


def _write_files(files: Mapping[str, bytes], folder: Path) -> None:
    for name, content in files.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
