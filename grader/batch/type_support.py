"""The interface packages that an assignment needs beside those of ROS."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from pathlib import Path

from grader.assignment.interfaces import FOLDER
from grader.assignment.load import LoadedAssignment
from grader.ros import RosInstallation
from grader.submission.build.build_cache import BuildCache
from grader.submission.build.underlay import completed, install_prefix

_WORD = re.compile(r"\w+")


class TypeSupport:
    """The built interface packages that the probe imports for an assignment."""

    def __init__(self, loaded: LoadedAssignment, ros: RosInstallation, cache: Path) -> None:
        """Set up; nothing is built yet."""
        self._loaded = loaded
        self._ros = ros
        self._cache = cache
        self._lock = threading.Lock()
        self._found: tuple[Path, ...] | None = None

    def prefixes(self, on_build: Callable[[str], None] = lambda _: None) -> tuple[Path, ...]:
        """Install spaces of these packages for the cell; what is missing is built first."""
        with self._lock:
            # The cache may be emptied while a class is graded, or rosgrade watches.
            if self._found is None or not all(path.is_dir() for path in self._found):
                self._found = self._built(on_build)
            return self._found

    def _built(self, on_build: Callable[[str], None]) -> tuple[Path, ...]:
        cache = BuildCache(self._cache)
        named = _WORD.findall(self._loaded.assignment.model_dump_json())
        ros = completed(self._ros, named, cache, on_build)
        own = self._loaded.folder / FOLDER
        if not own.is_dir():
            return ros.underlays
        return (install_prefix(own, ros, cache, on_build), *ros.underlays)
