"""The checks of one lesson: the Python package ``checks/`` beside assignment.yaml.

Its modules import each other (``from .conversion import ...``) and define checks as rosgrade's own
do, with :func:`grader.checks.check.check`. The assignment uses them by their names. They run in
the grader's own process: their author is trusted, a student never is.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from threading import Lock
from types import MappingProxyType, ModuleType

from grader import resources
from grader.assignment.own_check import naming_place
from grader.checks.catalogue import CATALOGUE, gather
from grader.checks.check import Check

FOLDER = "checks"
_IMPORTING = Lock()


def lesson_checks(assignment: Path) -> Mapping[str, Check]:
    """The checks in the package of an assignment's folder, by name.

    Raises:
        ValueError: A module cannot be imported, or a name is taken; the text says where.
    """
    folder = assignment / FOLDER
    files = sorted(folder.glob("*.py"))
    if not files:
        return MappingProxyType({})
    content = b"".join(file.name.encode() + file.read_bytes() for file in files)
    name = f"rosgrade_lesson_{sha256(str(folder.resolve()).encode() + content).hexdigest()[:16]}"
    with _IMPORTING:
        found = gather(_modules(name, folder, files))
    for taken in sorted(set(found) & set(CATALOGUE)):
        raise ValueError(f"{FOLDER}/: rosgrade has a check {taken!r} too: choose another name")
    return found


def _modules(package: str, folder: Path, files: list[Path]) -> list[ModuleType]:
    """Import the modules of a package that stands in no ``sys.path``."""
    if package not in sys.modules:
        module = ModuleType(package)
        module.__path__ = [str(folder)]
        sys.modules[package] = module
    # Bytecode goes to the cache, so that the assignment's folder and its hash stay as they are.
    before, sys.pycache_prefix = sys.pycache_prefix, str(resources.cache_folder() / "bytecode")
    try:
        with naming_place(folder, f"{FOLDER}/"):
            names = [one.stem for one in files if one.stem != "__init__"]
            return [import_module(f"{package}.{name}") for name in names]
    finally:
        sys.pycache_prefix = before


def all_checks() -> Mapping[str, Check]:
    """The catalogue with the checks of rosgrade's own lessons."""
    found = dict(CATALOGUE)
    for folder in sorted(resources.assignments().glob(f"*/{FOLDER}")):
        found.update(lesson_checks(folder.parent))
    return MappingProxyType(found)
