"""Interface packages of ours in a cell that runs already.

Cells start before it is known which assignment they will run, so the dynamic linker cannot be
told by a variable where the libraries of an assignment's own interface packages are.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterable
from pathlib import Path


def add_type_support(prefixes: Iterable[Path]) -> None:
    """Make the interfaces of install spaces of ours importable in this process."""
    for prefix in prefixes:
        sys.path[:0] = [str(path) for path in sorted(prefix.glob("lib/python3.*/site-packages"))]
        _load(sorted(prefix.glob("lib/lib*.so")))


def _load(libraries: list[Path]) -> None:
    """Load libraries that need each other: each one again until all that it needs are there.

    A library that is loaded is found by its name afterwards, wherever it lies.
    """
    while libraries:
        errors: dict[Path, OSError] = {}
        for library in libraries:
            try:
                ctypes.CDLL(str(library))
            except OSError as error:
                errors[library] = error
        if len(errors) == len(libraries):
            raise errors[libraries[0]]
        libraries = list(errors)
