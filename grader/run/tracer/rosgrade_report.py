"""How the tracer reports to the cell, and what both of its parts know of the run."""

from __future__ import annotations

import gc
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

FD = int(os.environ.get("ROSGRADE_TRACER_FD", "-1"))
SEEN_FD = int(os.environ.get("ROSGRADE_SEEN_FD", "-1"))
PAUSE_FD = int(os.environ.get("ROSGRADE_PAUSE_FD", "-1"))
HELD_TOPICS = frozenset(filter(None, os.environ.get("ROSGRADE_HOLD", "").split(":")))
# As ROS installs programs: PREFIX/lib/PACKAGE/PROGRAM. `ros2` itself is PREFIX/bin/ros2.
_LIB = os.path.dirname(os.path.dirname("".join(sys.orig_argv[1:2])))
INSTALL = os.path.dirname(_LIB) if _LIB.endswith("/lib") else ""
LEAST_THREADS = 4
THRESHOLDS = gc.get_threshold()
_PREFIXES = ("ROS_", "RMW_", "FASTDDS_", "FASTRTPS_", "CYCLONEDDS_")
_HARMLESS = ("ROS_LOG_DIR", "ROS_HOME", "ROS_DISTRO", "ROS_VERSION", "ROS_PYTHON_VERSION")
# Writes up to PIPE_BUF (4096 bytes) are atomic, so lines of several processes do not mix.
_LONGEST_LINE = 4000


def pipe_at(fd: int) -> tuple[int, int] | None:
    """Identity of a pipe, None for anything else."""
    try:
        status = os.fstat(fd)
    except OSError:
        return None
    return (status.st_dev, status.st_ino) if status.st_mode & 0o170000 == 0o010000 else None


def report(kind: str, **data: Any) -> None:
    """Send one line to the cell; without a listener nothing happens."""
    try:
        import json

        line = json.dumps({"kind": kind, "pid": os.getpid(), **data}) + "\n"
        # The program may have closed the pipe, and something else may have its number now.
        if len(line) <= _LONGEST_LINE and PIPE and pipe_at(FD) == PIPE:
            os.write(FD, line.encode())
    except Exception:
        pass


def quietly(function: Any, *args: Any) -> Any:
    """Call something, whose errors never reach the student's program."""
    try:
        return function(*args)
    except Exception:
        return None


def of_middleware() -> dict[str, str]:
    """Variables of the environment that decide which nodes discover each other."""
    found = {name: os.environ[name] for name in os.environ if name.startswith(_PREFIXES)}
    return {name: value for name, value in found.items() if name not in _HARMLESS}


MIDDLEWARE = of_middleware()
PIPE = pipe_at(FD)
PAUSE_PIPE = pipe_at(PAUSE_FD)
