"""Environment variables of the processes in a cell."""

from __future__ import annotations

import os
from pathlib import Path

import grader
from grader.ros import RosInstallation

_HERE = Path(__file__).resolve().parent
TRACER = _HERE / "tracer"
PROFILE = _HERE / "fast_discovery.xml"
RMW = "rmw_fastrtps_cpp"

_SHARED = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "RMW_IMPLEMENTATION": RMW,
    # NumPy comes with the messages; the idle threads of its BLAS would spin at every start.
    "OPENBLAS_NUM_THREADS": "1",
}


def cell_environment(ros: RosInstallation) -> dict[str, str]:
    """Variables of a cell: ROS, rosgrade itself, and the fast announcement of the probe."""
    environment = ros.environment(os.environ)
    root = Path(grader.__file__).resolve().parent.parent
    environment.update(
        _SHARED,
        PYTHONPATH=_joined(str(root), environment.get("PYTHONPATH", "")),
        FASTRTPS_DEFAULT_PROFILES_FILE=str(PROFILE),
    )
    return environment


def student_environment(ros: RosInstallation, install: Path, scratch: Path) -> dict[str, str]:
    """Variables of a student's process: ROS, the packages handed in, and the tracer.

    Args:
        ros: The installation.
        install: Install space of the submission.
        scratch: Home, working and temporary folder; exists.
    """
    environment = ros.environment(os.environ, (install,))
    temporary = scratch / "tmp"
    temporary.mkdir(exist_ok=True)
    environment.update(
        _SHARED,
        PYTHONPATH=_joined(str(TRACER), environment.get("PYTHONPATH", "")),
        # What is printed must be dated when it is printed, not when a buffer is full.
        PYTHONUNBUFFERED="1",
        RCUTILS_COLORIZED_OUTPUT="0",
        ROS_LOG_DIR=str(scratch / "log"),
        HOME=str(scratch),
        TMPDIR=str(temporary),
    )
    return environment


def _joined(*paths: str) -> str:
    return os.pathsep.join(path for path in paths if path)
