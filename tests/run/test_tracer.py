"""What the tracer changes in a student's process, seen without ROS."""

from __future__ import annotations

import os
import subprocess
import sys

from grader.run.environment import TRACER

_PROGRAM = """
import os
import pickle

for name in ("cpu_count", "process_cpu_count"):
    count = getattr(os, name, os.cpu_count)
    assert count() >= 4, count()
    assert pickle.loads(pickle.dumps(count)) is count
"""


def test_there_are_four_cpus_at_least_also_for_another_process() -> None:
    read, write = os.pipe()
    environment = {
        **os.environ,
        "PYTHONPATH": str(TRACER),
        "ROSGRADE_TRACER_FD": str(write),
        "ROSGRADE_TRACER_PIPE": str(os.fstat(write).st_ino),
    }
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM],
        env=environment,
        pass_fds=(write,),
        capture_output=True,
        text=True,
        check=False,
    )
    os.close(write)
    os.close(read)
    assert not done.returncode, done.stderr
