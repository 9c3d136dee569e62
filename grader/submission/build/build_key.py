"""The name of a build in the cache: a hash of everything that it depends on."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from grader.machine.ros import RosInstallation
from grader.submission.build.colcon import BuildLimits
from grader.submission.build.toolchain import watched_folders

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

# Raise it when the same submission would now be built differently.
_VERSION = 7
_TOOLS = ("cc", "c++", "cmake", "ld", "make", "ninja")


def build_key(
    sha256: str,
    ros: RosInstallation,
    limits: BuildLimits,
    sandbox: Sandbox | None,
    is_standalone: bool,
    tested: frozenset[str] = frozenset(),
) -> str:
    """Name a build by everything that it depends on."""
    watched = [prefix / "share/ament_index/resource_index/packages" for prefix in ros.prefixes]
    # colcon and setuptools come with ROS, too.
    watched += [ros.python, *ros.site_packages, *watched_folders()]
    # What compiles and links, behind all links such as /etc/alternatives.
    tools = (shutil.which(name, path=ros.environment({})["PATH"]) for name in _TOOLS)
    watched += [Path(tool).resolve() for tool in tools if tool is not None]
    parts = [
        _VERSION,
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
        repr((limits.output, limits.room)),
        sorted(sandbox.libraries) if sandbox is not None else None,
        is_standalone,
        sorted(tested),
    ]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()
