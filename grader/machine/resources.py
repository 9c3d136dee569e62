"""Where the files that are not Python code lie: assignments, references, templates, the cache.

In a checkout they stand beside the import package; a wheel carries them in
``grader/_data/``.
"""

from __future__ import annotations

import os
from pathlib import Path

from grader.errors import GraderFault

PACKAGE = Path(__file__).resolve().parent.parent


def root(package: Path = PACKAGE) -> Path:
    """The folder that holds ``assignments/``, ``reference/`` and ``templates/``."""
    for candidate in (package / "_data", package.parent):
        if (candidate / "assignments").is_dir():
            return candidate
    raise GraderFault(
        f"no assignments beside {package}: the installation of rosgrade is not complete; "
        "install it again"
    )


def assignments() -> Path:
    """The folder with one folder for each assignment."""
    return root() / "assignments"


def reference() -> Path:
    """The folder with the reference solutions, one folder for each assignment."""
    return root() / "reference"


def templates() -> Path:
    """The folder with the Jinja2 templates."""
    return root() / "templates"


def carried_interfaces() -> Path:
    """The folder with the interface packages that the wheels of ROS lack, each in its own."""
    return PACKAGE / "submission" / "interfaces"


UNDERLAYS, BUILDS, INSTALL = "underlays", "builds", "install"
"""Folders in the cache: of what ``rosgrade underlay add`` built, of builds, and in each build."""


def cache_folder() -> Path:
    """Folder for builds that may be deleted at any time (XDG Base Directory)."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "rosgrade"


def kept_underlays(cache: Path) -> list[Path]:
    """Install spaces of the underlays that were added on this machine."""
    return sorted(cache.glob(f"{UNDERLAYS}/{BUILDS}/*/{INSTALL}"))


def check_executable(folder: Path) -> None:
    """See that programs may be started from a folder; else it is a fault of the machine."""
    if os.statvfs(folder).f_flag & os.ST_NOEXEC:
        raise GraderFault(
            f"no program can be started from {folder}: it is on a file system that is mounted "
            "noexec; let XDG_CACHE_HOME name a folder on another"
        )
