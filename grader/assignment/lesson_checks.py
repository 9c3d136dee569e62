"""Lesson checks: those that an author defines in the package ``checks/`` beside assignment.yaml.

Its modules define checks as rosgrade's own do and import each other (``from .conversion import
...``), so they are imported as a package. A single file of functions is no package: see
:mod:`grader.assignment.own_check`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from threading import Lock
from types import MappingProxyType, ModuleType

from grader.assignment.own_check import naming_place
from grader.checks.catalogue import CATALOGUE, gather
from grader.checks.check import Check
from grader.machine import resources

FOLDER = "checks"
_IMPORTING = Lock()
"""``sys.pycache_prefix`` holds for all threads."""


def lesson_checks(assignment: Path) -> Mapping[str, Check]:
    """The checks in the package of an assignment's folder, by name."""
    folder = assignment / FOLDER
    files = sorted(folder.glob("*.py"))
    if not files:
        return MappingProxyType({})
    names = [file.stem for file in files if file.stem != "__init__"]
    with _IMPORTING:
        package = _package(folder, files)
        with _bytecode_in_cache(), naming_place(folder, f"{FOLDER}/"):
            modules = [import_module(f"{package}.{name}") for name in names]
    checks = gather(modules)
    taken = sorted(set(checks) & set(CATALOGUE))
    if taken:
        raise ValueError(f"{FOLDER}/: rosgrade has a check {taken[0]!r} too: choose another name")
    return checks


def _package(folder: Path, files: list[Path]) -> str:
    """The name of a package for these files, under which their modules can be imported.

    It stands in no ``sys.path``. The hash in its name lets two versions of it, and those of several
    assignments, be imported side by side.
    """
    content = b"".join(file.name.encode() + file.read_bytes() for file in files)
    name = f"rosgrade_lesson_{sha256(str(folder.resolve()).encode() + content).hexdigest()[:16]}"
    if name not in sys.modules:
        package = ModuleType(name)
        package.__path__ = [str(folder)]
        sys.modules[name] = package
    return name


@contextmanager
def _bytecode_in_cache() -> Iterator[None]:
    """Write no bytecode beside the modules, so that the assignment keeps its hash."""
    before = sys.pycache_prefix
    sys.pycache_prefix = str(resources.cache_folder() / "bytecode")
    try:
        yield
    finally:
        sys.pycache_prefix = before


def all_checks() -> Mapping[str, Check]:
    """The catalogue with the checks of rosgrade's own lessons."""
    checks = dict(CATALOGUE)
    for folder in sorted(resources.assignments().glob(f"*/{FOLDER}")):
        checks.update(lesson_checks(folder.parent))
    return MappingProxyType(checks)
