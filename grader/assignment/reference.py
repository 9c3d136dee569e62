"""Whether the reference solution has the packages and executables that an assignment names."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.assignment.mutation import reference_of
from grader.errors import Problem, UsageError
from grader.spec.nearest_name import did_you_mean
from grader.spec.source import read_source
from grader.submission.read.entrypoints import read_setup
from grader.submission.read.manifest import MANIFEST, read_manifest


def reference_problems(loaded: LoadedAssignment) -> Iterator[Problem]:
    """Find what the reference lacks; nothing where there is no reference."""
    try:
        reference = reference_of(loaded.assignment.id, loaded.folder)
    except UsageError:
        return
    source = read_source(loaded.file)
    folders = {
        read_manifest(file.read_bytes(), MANIFEST, {}).name: file.parent
        for file in sorted(reference.rglob(MANIFEST))
    }
    for index, package in enumerate(loaded.assignment.packages):
        folder = folders.get(package.name)
        if folder is None:
            known = [name for name in folders if name]
            text = f"the reference solution has no package {package.name!r}."
            yield source.problem(
                ("packages", index, "name"), text + did_you_mean(package.name, known)
            )
            continue
        there = _executables(folder)
        for number, name in enumerate(package.executables):
            if name not in there:
                files = " or ".join(file for file in _BUILD_FILES if (folder / file).is_file())
                text = f"the reference solution has no executable {name!r} in {files}."
                place = ("packages", index, "executables", number)
                yield source.problem(place, text + did_you_mean(name, there))


_BUILD_FILES = ("setup.py", "setup.cfg", "CMakeLists.txt")


def _executables(folder: Path) -> set[str]:
    """Names of executables that a package may install; of CMake and scripts every word."""
    setup_py, setup_cfg, cmake = (
        (folder / name).read_bytes() if (folder / name).is_file() else None for name in _BUILD_FILES
    )
    found = {entry.name for entry in read_setup(setup_py, setup_cfg, ".").entry_points}
    if not found:
        text = ((setup_py or b"") + (cmake or b"")).decode("utf-8", "replace")
        found = set(re.findall(r"[\w.-]+", text))
    return found
