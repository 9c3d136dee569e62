"""The name of a build: everything that it depends on, as a hash."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Sequence
from pathlib import Path

from grader.ros import RosInstallation
from grader.submission.build.installed import site_packages
from grader.submission.build.toolchain import watched_folders

VERSION = 4
"""Raise it when the same submission would now be built differently."""

_TOOLS = ("cc", "c++", "cmake", "ld", "make", "ninja")


def build_key(
    sha256: str, ros: RosInstallation, *, sandboxed: bool = False, terms: Sequence[str] = ()
) -> str:
    """Name a build by everything that it depends on."""
    watched = [prefix / "share/ament_index/resource_index/packages" for prefix in ros.prefixes]
    watched += [ros.python, *site_packages_of(ros), *_tools(ros), *watched_folders()]
    parts = [
        VERSION,
        sha256,
        ros.source,
        ros.distro,
        str(ros.python),
        [str(prefix) for prefix in ros.prefixes],
        ros.inherited,
        # An underlay is an install space in the cache, below the name of its build.
        [str(underlay) for underlay in ros.underlays],
        [(str(path), path.stat().st_mtime_ns) for path in watched if path.exists()],
        sorted(ros.packages),
        *(["sandbox"] if sandboxed else []),
        *terms,
    ]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def site_packages_of(ros: RosInstallation) -> list[Path]:
    """Folders that hold colcon and setuptools, as far as they come with this ROS."""
    return [path for prefix in ros.prefixes for path in site_packages(prefix)]


def _tools(ros: RosInstallation) -> list[Path]:
    """What compiles and links, behind all links such as /etc/alternatives."""
    path = ros.environment({})["PATH"]
    found = (shutil.which(name, path=path) for name in _TOOLS)
    return [Path(tool).resolve() for tool in found if tool is not None]
