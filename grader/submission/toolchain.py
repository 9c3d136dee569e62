"""The compiler and CMake, which packages that are not pure Python need, and Python's headers."""

from __future__ import annotations

import shutil
import sys
import sysconfig
from pathlib import Path

from grader.errors import GraderFault

_PACKAGES = {"cmake": "cmake", "c++": "g++", "make": "make"}
# CMake's FindPython3 names the part of it that it did not find.
_NO_HEADERS = "Development.Module"
_HINT = "a package that is not pure Python has to be built, and this machine cannot compile:"


def check_toolchain(path: str) -> None:
    """See that what compiles is there.

    Args:
        path: Where programs are looked for, as in ``PATH``.

    Raises:
        GraderFault: Something is not installed on this machine.
    """
    missing = [package for tool, package in _PACKAGES.items() if not shutil.which(tool, path=path)]
    if missing:
        raise GraderFault(f"{_HINT} sudo apt install {' '.join(missing)}")


def check_headers(output: str) -> None:
    """See that a build did not fail for want of Python's headers, which interfaces need.

    Args:
        output: Of the build.

    Raises:
        GraderFault: They are not installed on this machine.
    """
    if _NO_HEADERS in output and not has_headers():
        raise GraderFault(f"{_HINT} sudo apt install {headers_package()}")


def has_headers() -> bool:
    """Whether this machine has Python's headers."""
    return Path(sysconfig.get_path("include"), "Python.h").is_file()


def headers_package() -> str:
    """The package of Debian and Ubuntu that has them."""
    return f"python{sys.version_info.major}.{sys.version_info.minor}-dev"
