"""Environment variables of the processes in a cell."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import grader
from grader.machine.ros import RosInstallation
from grader.run.process.process_sandbox import HOME

_HERE = Path(__file__).resolve().parent
TRACER = _HERE / "tracer"
TRACER_IN_SANDBOX = Path("/opt/tracer")
PROFILE = _HERE / "fast_discovery.xml"
RMW = "rmw_fastrtps_cpp"

_SHARED = {
    "RMW_IMPLEMENTATION": RMW,
    # NumPy comes with the messages; the idle threads of its BLAS would spin at every start.
    "OPENBLAS_NUM_THREADS": "1",
}
_HOST_NETWORK = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
# Shared memory does not reach from one sandbox into another, and no error says so: publishers are
# seen, and their messages lost. LOCALHOST would switch it on again; there is only `lo` anyway.
_OWN_NETWORK = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
}
_OF_THE_CALLER = ("XDG_RUNTIME_DIR", "USER")
_INSIDE = {"HOME": "/tmp", "TMPDIR": "/tmp"}
COMPANION_IN_CELL = {**_INSIDE, "ROS_LOG_DIR": "/tmp/.ros/log"}
"""Of a program of the author's in the sandbox of a cell."""


def cell_environment(ros: RosInstallation, *, sandboxed: bool = False) -> dict[str, str]:
    """Variables of a cell: ROS, rosgrade itself, and the fast announcement of the probe."""
    environment = ros.environment(os.environ)
    root = Path(grader.__file__).resolve().parent.parent
    environment.update(
        _SHARED,
        PYTHONPATH=_joined(str(root), environment.get("PYTHONPATH", "")),
        FASTRTPS_DEFAULT_PROFILES_FILE=str(PROFILE),
        **(_OWN_NETWORK | _INSIDE if sandboxed else _HOST_NETWORK),
    )
    if sandboxed:
        environment.pop("XDG_RUNTIME_DIR", None)
    return environment


def companion_environment(
    ros: RosInstallation, scratch: Path, installs: tuple[Path, ...] = ()
) -> dict[str, str]:
    """Variables of a program of the author's: ROS and the packages beside the assignment."""
    environment = ros.environment(os.environ, installs)
    temporary = scratch / "tmp"
    temporary.mkdir(exist_ok=True)
    environment.update(
        _SHARED,
        **_HOST_NETWORK,
        # What is printed must be dated when it is printed, not when a buffer is full.
        PYTHONUNBUFFERED="1",
        RCUTILS_COLORIZED_OUTPUT="0",
        ROS_LOG_DIR=str(scratch / "log"),
        HOME=str(scratch),
        TMPDIR=str(temporary),
    )
    return environment


def student_environment(
    ros: RosInstallation,
    installs: tuple[Path, ...],
    scratch: Path,
    compiled_tracer: Path | None = None,
) -> dict[str, str]:
    """Variables of a student's process: ROS, the packages handed in, and the tracers."""
    environment = companion_environment(ros, scratch, installs)
    environment["PYTHONPATH"] = _joined(str(TRACER), environment.get("PYTHONPATH", ""))
    if compiled_tracer is not None:
        environment["LD_PRELOAD"] = _joined(str(compiled_tracer), ros.preloaded)
    return environment


def sandboxed_environment(
    environment: Mapping[str, str], places: Mapping[str, str]
) -> dict[str, str]:
    """The same variables of a student's process for one in a sandbox."""
    found = {name: value for name, value in environment.items() if name not in _OF_THE_CALLER}
    for outside, inside in places.items():
        found = {name: value.replace(outside, inside) for name, value in found.items()}
    home = {"HOME": HOME, "USER": "student", "TMPDIR": "/tmp", "ROS_LOG_DIR": f"{HOME}/.ros/log"}
    return found | _OWN_NETWORK | home


def _joined(*paths: str) -> str:
    return os.pathsep.join(path for path in paths if path)
