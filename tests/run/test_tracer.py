"""What the tracer changes in a student's process, seen without ROS."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

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


@pytest.mark.ros
def test_a_program_that_ends_by_a_missing_field_tells_those_that_are_there() -> None:
    program = "from geometry_msgs.msg import Vector3; Vector3().w = 1.0"
    told = run_traced(program, status=1).splitlines()
    assert json.loads(told[-1])["fields"] == "x y z"


_SENDS = """
import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Path
from rclpy.clock import Clock
from std_msgs.msg import Int32

rclpy.init()
node = rclpy.create_node("bot")
message = {wrong}
node.create_publisher(type(message), "topic", 10).publish(message)
"""


@pytest.mark.ros
@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        ("PoseStamped(); message.header.stamp = Clock().now()", "header.stamp"),
        (
            "Path(poses=[PoseStamped()]); message.poses[0].header.stamp = Clock().now()",
            "poses.header.stamp",
        ),
        ("Twist(); message.linear = 1.0", "linear"),
        ("Int32(); message.data = 1.5", "data"),
    ],
)
def test_a_program_that_cannot_send_a_message_tells_the_field(wrong: str, field: str) -> None:
    told = map(json.loads, run_traced(_SENDS.replace("{wrong}", wrong), status=1).splitlines())
    assert [one["field"] for one in told if one["kind"] == "exiting"] == [field]


_IMPORTS = """
import importlib
import other
import one
__import__("two")
importlib.import_module("th" + "ree")
exec("import four")
try:
    import five
except ImportError:
    pass
importlib.import_module("js" + "on")
importlib.import_module("other")
"""


_SPAWNS = """
import multiprocessing

if __name__ == "__main__":
    child = multiprocessing.get_context("spawn").Process(target=print)
    child.start()
    child.join()
    with open(__file__ + ".pid", "w") as file:
        file.write(str(child.pid))
"""


def test_a_process_that_multiprocessing_spawns_is_heard(tmp_path: Path) -> None:
    program = tmp_path / "program"
    program.write_text(_SPAWNS)
    lines = [json.loads(line) for line in run_traced(str(program)).splitlines()]
    child = int((tmp_path / "program.pid").read_text())
    assert child in [line["pid"] for line in lines if line["kind"] == "started"]


def test_what_the_code_itself_imports_is_declared_where_it_needs_it(tmp_path: Path) -> None:
    folder = tmp_path / "install" / "lib" / "package"
    folder.mkdir(parents=True)
    for name in ("one", "two", "three", "four", "five"):
        (folder / f"{name}.py").touch()
    library = tmp_path / "library"
    library.mkdir()
    (library / "other.py").write_text("import needed")
    (library / "needed.py").touch()
    (folder / "program").write_text(_IMPORTS)
    told = run_traced(str(folder / "program"), library)
    lines = [json.loads(line) for line in told.splitlines()]
    found = [(line["module"], line["line"]) for line in lines if line["kind"] == "imported"]
    assert found == [("other", 3), ("one", 4), ("two", 5), ("three", 6), ("four", 7)]


def run_traced(program: str, *paths: Path, status: int = 0) -> str:
    """The declarations of a traced program, a file or its text, which ends with a status."""
    read, write = os.pipe()
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, (TRACER, *paths))),
        "ROSGRADE_TRACER_FD": str(write),
        "ROSGRADE_TRACER_PIPE": str(os.fstat(write).st_ino),
    }
    done = subprocess.run(
        [sys.executable, *([] if program.startswith("/") else ["-c"]), program],
        env=environment,
        pass_fds=(write,),
        capture_output=True,
        text=True,
        check=False,
    )
    os.close(write)
    assert done.returncode == status, done.stderr
    with os.fdopen(read, encoding="utf-8") as told:
        return told.read()
