"""The reference solution of an assignment, in each language that it has one in."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from grader.errors import UsageError
from grader.machine import resources


@dataclass(frozen=True)
class Language:
    """Where the solution in one language and its mutants lie.

    Attributes:
        key: What an entry of mutants.yaml calls it.
        mutants: Name of the file beside assignment.yaml.
        reference: Name of the folder beside assignment.yaml.
        shipped: The folder in ``reference/`` with the solutions of rosgrade's own assignments.
    """

    key: Literal["python", "cpp"]
    mutants: str
    reference: str
    shipped: str


PYTHON = Language("python", "mutants.yaml", "reference", ".")
CPP = Language("cpp", "mutants_cpp.yaml", "reference_cpp", "cpp")
LANGUAGES = (PYTHON, CPP)

_LEFT_BY_BUILDS = {"__pycache__", "build", "install", "log"}


def reference_of(assignment: str, folder: Path | None = None, language: Language = PYTHON) -> Path:
    """The folder of an assignment's reference solution: beside it, or rosgrade's own."""
    places = [resources.reference() / language.shipped / assignment]
    if folder is not None:
        places.insert(0, folder / language.reference)
    for place in places:
        if place.is_dir():
            return place
    listed = " or ".join(map(str, places))
    is_shipped = folder is None or folder.is_relative_to(resources.root())
    lacks_solutions = is_shipped and not resources.reference().is_dir()
    advice = "; install rosgrade-solutions" if lacks_solutions else ""
    raise UsageError(f"the assignment {assignment!r} has no reference solution: {listed}{advice}")


def read_files(folder: Path) -> dict[str, bytes]:
    """All files of a folder by path, without what a build leaves."""
    return {
        inside.as_posix(): (folder / inside).read_bytes()
        for inside in sorted(file.relative_to(folder) for file in folder.rglob("*"))
        if (folder / inside).is_file() and not _LEFT_BY_BUILDS.intersection(inside.parts)
    }
