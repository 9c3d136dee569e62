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
    """Make the interfaces of install spaces importable in this process.

    Args:
        prefixes: Install spaces of ours (merged layout), never a student's.

    Raises:
        OSError: A library cannot be loaded.
    """
    for prefix in prefixes:
        sys.path[:0] = [str(path) for path in sorted(prefix.glob("lib/python3.*/site-packages"))]
        _load(sorted(prefix.glob("lib/lib*.so")))


def _load(libraries: list[Path]) -> None:
    """Load libraries that need each other, in whatever order that takes.

    A library that is loaded is found by its name afterwards, wherever it lies.
    """
    while libraries:
        waiting: list[Path] = []
        error: OSError | None = None
        for library in libraries:
            try:
                ctypes.CDLL(str(library))
            except OSError as caught:
                waiting.append(library)
                error = error or caught
        if error is not None and len(waiting) == len(libraries):
            raise error
        libraries = waiting
