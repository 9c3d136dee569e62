"""What the tracer changes in a student's process, seen without ROS."""

from __future__ import annotations

import json
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


_CLOSES = """
import os
import subprocess
import sys

os.closerange(3, 4096)
for fd in range(3, 256):
    try:
        os.close(fd)
    except OSError:
        pass
read, write = os.pipe()
os.close(read)
os.closerange(write, write + 1)
try:
    os.fstat(write)
except OSError:
    subprocess.run([sys.executable, "-c", ""], check=True)
"""


def test_there_are_four_cpus_at_least_also_for_another_process() -> None:
    run_traced(_PROGRAM)


def test_a_program_that_closes_all_descriptors_and_its_child_are_still_heard() -> None:
    lines = [json.loads(line) for line in run_traced(_CLOSES).splitlines()]
    kinds = [line["kind"] for line in lines]
    assert kinds == ["started", "started", "exiting", "exiting"]
    assert lines[0]["pid"] == lines[3]["pid"] != lines[1]["pid"] == lines[2]["pid"]


def run_traced(program: str) -> str:
    """What the tracer says of a program, which must end well."""
    read, write = os.pipe()
    environment = {
        **os.environ,
        "PYTHONPATH": str(TRACER),
        "ROSGRADE_TRACER_FD": str(write),
        "ROSGRADE_TRACER_PIPE": str(os.fstat(write).st_ino),
    }
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        pass_fds=(write,),
        capture_output=True,
        text=True,
        check=False,
    )
    os.close(write)
    assert not done.returncode, done.stderr
    with os.fdopen(read, encoding="utf-8") as told:
        return told.read()
