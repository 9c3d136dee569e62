"""The files of an assignment that students may have: no solution, no mutants, no hidden checks."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from grader.assignment.contract.expand import expanded_with
from grader.assignment.contract.table import with_table
from grader.assignment.lesson_checks import FOLDER, lesson_checks
from grader.assignment.load import ASSIGNMENT_FILE, LoadedAssignment
from grader.assignment.model import Assignment, Visibility
from grader.assignment.reference import LANGUAGES
from grader.assignment.repeat import runs_of
from grader.assignment.selection import visible_part
from grader.grading.reference_run import REFERENCE_FILE, only_scenarios
from grader.report.html.handout import HANDOUT_FILE
from grader.spec.document import write_yaml

_CUT = "# Made by rosgrade: this copy lacks the hidden checks, which run at grading.\n"


def grading_files(loaded: LoadedAssignment) -> dict[str, bytes]:
    """The files that grading needs, by path: all but its solution and its mutants."""
    solutions = {name for one in LANGUAGES for name in (one.mutants, one.reference)}
    files = {}
    for path in files_in(loaded.folder):
        inside = path.relative_to(loaded.folder)
        if inside.parts[0] not in solutions:
            files[inside.as_posix()] = path.read_bytes()
    return files


def visible_files(loaded: LoadedAssignment) -> dict[str, bytes]:
    """The files that students may have, by path.

    With hidden checks, the YAML is written anew, without comments: one may speak of them. What
    only hidden checks and their scenarios name is left out: worlds, own checks, messages.
    """
    files = grading_files(loaded)
    if HANDOUT_FILE in files:
        text = files[HANDOUT_FILE].decode("utf-8", "surrogateescape")
        whole = with_table(text, loaded.assignment)
        files[HANDOUT_FILE] = whole.encode("utf-8", "surrogateescape")
    part = visible_part(loaded)
    if part is loaded:
        return files
    assert loaded.source is not None
    data, cut = loaded.source.data, _visible_data(loaded, part)
    for path in list(files):
        if _names(data, path, loaded) and not _names(cut, path, loaded):
            del files[path]
    files[ASSIGNMENT_FILE] = (_CUT + write_yaml(cut)).encode()
    if REFERENCE_FILE in files:
        shown = {scenario.id for scenario in part.assignment.scenarios}
        files[REFERENCE_FILE] = only_scenarios(loaded.folder / REFERENCE_FILE, shown)
    return files


def files_in(folder: Path) -> Iterator[Path]:
    """Every file in a folder, without caches and hidden ones, sorted."""
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder).parts
        ignored = any(part.startswith(".") or part == "__pycache__" for part in inside)
        if path.is_file() and not ignored:
            yield path


def _visible_data(loaded: LoadedAssignment, part: LoadedAssignment) -> dict[str, Any]:
    """What the YAML says, with only the number and the points of the hidden checks."""
    assert loaded.source is not None
    data = loaded.source.data
    shown = {scenario.id for scenario in part.assignment.scenarios}
    scenarios = expanded_with(loaded.source, loaded.values).read(Assignment).scenarios
    # Those of a contract come first, and none of them is hidden.
    written = data.get("checks") or []
    authors = loaded.checks[len(loaded.checks) - len(written) :]
    kept = {
        "checks": [
            entry
            for entry, bound in zip(written, authors, strict=True)
            if bound.spec.visibility is Visibility.VISIBLE
        ],
        "scenarios": [
            entry
            for entry, scenario in zip(data.get("scenarios") or [], scenarios, strict=True)
            if shown.intersection(runs_of(scenario))
        ],
        "withheld": {"checks": part.withheld.checks, "points": part.withheld.points},
    }
    return {name: value for name, value in {**data, **kept}.items() if name != "points"}


def _names(data: Any, path: str, loaded: LoadedAssignment) -> bool:
    """Whether a text in the YAML names a file, or a check that the file defines."""
    texts = json.dumps(data, ensure_ascii=False, default=str)
    if path in texts:
        return True
    if not path.startswith(f"{FOLDER}/"):
        return False
    module = path.removeprefix(f"{FOLDER}/").removesuffix(".py")
    for name, check in lesson_checks(loaded.folder).items():
        is_defined_there = check.judge.__module__.rpartition(".")[2] == module
        if is_defined_there and f'"{name}"' in texts:
            return True
    return False
