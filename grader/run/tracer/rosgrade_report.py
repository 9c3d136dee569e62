"""How the tracer reports to the cell, and what its other modules know of the run.

It runs inside the student's program, as all of the tracer: see ``sitecustomize.py`` for why it
imports so little, and why no error may leave it.
"""

from __future__ import annotations

import gc
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

FD = int(os.environ.get("ROSGRADE_TRACER_FD", "-1"))
"""The pipe that takes reports."""
SEEN_FD = int(os.environ.get("ROSGRADE_SEEN_FD", "-1"))
"""The pipe that ends when the cell has seen what this process declared, and it may exit."""
PAUSE_FD = int(os.environ.get("ROSGRADE_PAUSE_FD", "-1"))
"""The pipe that can be read while executors shall find nothing ready."""
HELD_TOPICS = frozenset(filter(None, os.environ.get("ROSGRADE_HOLD", "").split(":")))
"""Topics whose publishers are held until the probe has matched them."""
LEAST_THREADS = 4
"""CPUs that a program sees at least, and so threads of an executor."""
THRESHOLDS = gc.get_threshold()
"""When Python collects garbage, before the tracer changes it."""
_PIPE_FORMAT, _PIPE = 0o170000, 0o010000
"""As in inode(7); `stat` would be one more module to import."""
_MIDDLEWARE_PREFIXES = ("ROS_", "RMW_", "FASTDDS_", "FASTRTPS_", "CYCLONEDDS_")
_HARMLESS = ("ROS_LOG_DIR", "ROS_HOME", "ROS_DISTRO", "ROS_VERSION", "ROS_PYTHON_VERSION")
_LONGEST_LINE = 4000
"""Writes up to PIPE_BUF (4096 bytes) are atomic, so lines of several processes do not mix."""


def quietly(function: Any, *args: Any) -> Any:
    """Call something, whose errors never reach the student's program."""
    try:
        return function(*args)
    except Exception:
        return None


def pipe_at(fd: int) -> tuple[int, int] | None:
    """Identity of a pipe, None for anything else."""
    try:
        status = os.fstat(fd)
    except OSError:
        return None
    is_pipe = status.st_mode & _PIPE_FORMAT == _PIPE
    return (status.st_dev, status.st_ino) if is_pipe else None


def install_of(program: str) -> str:
    """The install space of a program, as ``/ws/install`` of ``/ws/install/lib/bot/driver``.

    Empty for what lies elsewhere, such as `ros2` itself in PREFIX/bin.
    """
    folder = os.path.dirname(os.path.dirname(program))
    return os.path.dirname(folder) if folder.endswith("/lib") else ""


def middleware_variables() -> dict[str, str]:
    """Variables of the environment that decide which nodes discover each other."""
    return {
        name: value
        for name, value in os.environ.items()
        if name.startswith(_MIDDLEWARE_PREFIXES) and name not in _HARMLESS
    }


INSTALL = install_of(sys.orig_argv[1] if len(sys.orig_argv) > 1 else "")
MIDDLEWARE = middleware_variables()
PIPE, PAUSE_PIPE = pipe_at(FD), pipe_at(PAUSE_FD)


def report(kind: str, **data: Any) -> None:
    """Send one line to the cell; without a listener nothing happens."""
    quietly(_write, {"kind": kind, "pid": os.getpid(), **data})


def _write(declaration: dict[str, Any]) -> None:
    import json

    line = json.dumps(declaration) + "\n"
    # The program may have closed the pipe, and something else may have its number now.
    if len(line) <= _LONGEST_LINE and PIPE and pipe_at(FD) == PIPE:
        os.write(FD, line.encode())
