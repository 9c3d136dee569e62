"""Real builds with colcon, good ones and those that students manage to break."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest

from grader.diagnosis.not_built import why_not_built
from grader.errors import GraderFault
from grader.findings.finding import Status
from grader.machine.ros import RosInstallation
from grader.recording.submission import BuildRecord, PackageRecord
from grader.run.process.descendants import descendants
from grader.sandbox.limits import BUILD
from grader.sandbox.sandbox import Sandbox
from grader.sandbox.trial import try_sandbox
from grader.sandbox.usage import Usage
from grader.submission.build.build_key import build_key
from grader.submission.build.colcon import BuildLimits, builds_at_once
from grader.submission.build.own_time import OwnTime
from grader.submission.prepare import Preparation, Prepared, prepare
from tests.checks.builder import judge
from tests.submission.samples import INTERFACES, MANIFEST, NODE, SETUP_PY, Tree, zip_bytes

pytestmark = pytest.mark.ros

FOLDER = "src/bot_publisher"


def prepared(tree: Tree, ros: RosInstallation, python_s: float = 60.0) -> Prepared:
    limits = BuildLimits(python_s=python_s)
    cache = tree.root.parent / "cache"
    return prepare(tree.root, Preparation(ros=ros, cache=cache, limits=limits))


def build_of(found: Prepared) -> BuildRecord:
    assert found.record.problem is None
    assert found.record.build is not None
    return found.record.build


def package_of(found: Prepared, name: str = "bot_publisher") -> PackageRecord:
    package = found.record.package(name)
    assert package is not None
    return package


def run(found: Prepared, ros: RosInstallation, executable: str) -> str:
    """Run an executable of the install space as a cell does."""
    assert found.install is not None
    return subprocess.run(
        [str(ros.python), str(found.install / "lib" / executable)],
        env=ros.environment({"HOME": str(found.install)}, (found.install,)),
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    ).stdout


def test_a_good_package_is_built_and_runs(tree: Tree, real_ros: RosInstallation) -> None:
    tree.package()
    found = prepared(tree, real_ros)
    build = build_of(found)
    assert (build.succeeded, build.cached, build.timed_out) == (True, False, False)
    assert (build.failed_packages, build.culprit) == ((), None)
    assert str(tree.root.parent) not in build.log
    package = package_of(found)
    assert package.executables == ("bot_pub",)
    assert package.misplaced_executables == package.missing_targets == ()
    assert package.entry_points == (("bot_pub", "bot_publisher.node:main"),)
    assert dict(package.files) == {
        "bot_publisher/__init__.py": f"{FOLDER}/bot_publisher/__init__.py",
        "bot_publisher/node.py": f"{FOLDER}/bot_publisher/node.py",
    }
    assert "geometry_msgs.msg.Twist" in run(found, real_ros, "bot_publisher/bot_pub")
    assert found.install is not None
    assert list(found.install.rglob("bot_publisher/__pycache__/node.*.pyc"))


def test_the_second_time_it_comes_from_the_cache(tree: Tree, real_ros: RosInstallation) -> None:
    tree.package()
    first = prepared(tree, real_ros)
    second = prepared(tree, real_ros)
    assert build_of(second).cached
    assert build_of(second).duration_s == build_of(first).duration_s
    assert second.install == first.install
    assert second.record.packages == first.record.packages
    tree.write({f"{FOLDER}/bot_publisher/node.py": f"{NODE}\n"})
    assert not build_of(prepared(tree, real_ros)).cached


def test_a_zip_of_a_whole_workspace_is_built_once(
    tree: Tree, tmp_path: Path, real_ros: RosInstallation
) -> None:
    root = tree.package()
    subprocess.run(
        [str(real_ros.python), str(real_ros.python.parent / "colcon"), "build"],
        cwd=root,
        env={**real_ros.environment({}), "COLCON_HOME": str(tmp_path), "HOME": str(tmp_path)},
        capture_output=True,
        check=True,
        timeout=600,
    )
    assert {path.name for path in root.iterdir()} == {"build", "install", "log", "src"}
    files = [path for path in root.rglob("*") if path.is_file()]
    content = ((f"ws/{path.relative_to(root)}", path.read_bytes()) for path in files)
    archive = tmp_path / "alice.zip"
    archive.write_bytes(zip_bytes(*content))
    found = prepare(archive, Preparation(ros=real_ros, cache=tmp_path / "cache"))
    assert [package.path for package in found.record.packages] == [FOLDER]
    assert build_of(found).succeeded


def test_odd_names_of_folders_are_built(tree: Tree, real_ros: RosInstallation) -> None:
    tree.package(folder="my bot/größe 🤖\n/'x'")
    tree.write({"README": "A folder around everything would be left out of the path."})
    found = prepared(tree, real_ros)
    assert build_of(found).succeeded
    assert package_of(found).path == "my bot/größe 🤖\\n/'x'"
    assert package_of(found).executables == ("bot_pub",)


def test_without_setup_cfg_and_with_a_syntax_error_in_a_node_it_is_built(
    tree: Tree, real_ros: RosInstallation
) -> None:
    tree.package({"setup.cfg": None, "bot_publisher/node.py": "def main(:\n    pass\n"})
    found = prepared(tree, real_ros)
    assert [error.line for error in package_of(found).syntax_errors] == [1]
    assert build_of(found).succeeded
    assert package_of(found).executables == ()
    assert package_of(found).misplaced_executables == ("bin/bot_pub",)


def test_an_executable_in_the_folder_of_another_package_is_found_there(
    tree: Tree, real_ros: RosInstallation
) -> None:
    tree.package({"setup.cfg": "[install]\ninstall_scripts=$base/lib/my_package\n"})
    found = package_of(prepared(tree, real_ros))
    assert (found.executables, found.misplaced("bot_pub")) == ((), "lib/my_package/bot_pub")


def test_a_bad_e_mail_is_reported_and_does_not_hide_other_packages(
    tree: Tree, real_ros: RosInstallation
) -> None:
    tree.package({"package.xml": MANIFEST.replace("ada@example.org", "a@b.c")})
    other = {
        "package.xml": MANIFEST.replace("bot_publisher", "other"),
        "setup.py": SETUP_PY.replace("'bot_publisher'", "'other'").replace("bot_pub ", "other "),
        "setup.cfg": "[install]\ninstall_scripts=$base/lib/other\n",
        "resource/other": "",
        "other/__init__.py": "",
    }
    tree.package(dict(other), folder="src/other")
    found = prepared(tree, real_ros)
    error = package_of(found).manifest_error
    assert error is not None
    assert str(error) == f'{FOLDER}/package.xml:6: Invalid email "a@b.c" for person "Ada"'
    assert package_of(found, "other").manifest_error is None
    assert package_of(found, "other").executables == ("other",)


def test_a_setup_py_that_raises_does_not_keep_others_from_being_built(
    tree: Tree, real_ros: RosInstallation
) -> None:
    tree.package()
    for name in ("aaa_notes", "zzz_notes"):
        broken = {
            "package.xml": MANIFEST.replace("bot_publisher", name),
            "setup.py": "raise RuntimeError('not finished')\n",
            "resource/bot_publisher": None,
        }
        tree.package(broken, folder=f"src/{name}")
    waiting = {
        "package.xml": MANIFEST.replace("bot_publisher", "waiting").replace("rclpy", "aaa_notes"),
        "setup.py": SETUP_PY.replace("'bot_publisher'", "'waiting'"),
    }
    tree.package(dict(waiting), folder="src/waiting")
    found = prepared(tree, real_ros)
    build = build_of(found)
    assert build.failed_packages == ("aaa_notes", "waiting", "zzz_notes")
    assert str(build.culprit) == "src/aaa_notes/setup.py:1: RuntimeError: not finished"
    assert package_of(found).executables == ("bot_pub",)


DAEMON = """
import os, sys, time
if 'install' in sys.argv and os.fork() == 0:
    os.setsid()
    time.sleep(300)
    os._exit(0)
"""


def test_a_daemon_of_setup_py_that_holds_the_output_costs_the_wall_limit_at_most(
    tree: Tree, real_ros: RosInstallation
) -> None:
    # colcon itself waits until its pipe is closed, for as long as the daemon lives.
    tree.package({"setup.py": f"{DAEMON}\n{SETUP_PY}"})
    started = time.monotonic()
    found = prepared(tree, real_ros, python_s=8.0)
    assert time.monotonic() - started < 25
    build = build_of(found)
    assert (build.succeeded, build.timed_out, found.install) == (False, True, None)
    ended = "the build was ended after 8 s: it waited for something"
    assert (str(build.culprit), build.waited) == (f"{FOLDER}/setup.py: {ended}", True)
    assert not build_of(prepared(tree, real_ros, python_s=0.1)).cached


def test_setup_py_does_not_see_the_callers_home_and_variables(
    tree: Tree, real_ros: RosInstallation, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in {"SECRET": "token", "HOME": "/home/grader", "USER": "token"}.items():
        monkeypatch.setenv(name, value)
    told = "import os, sys\nprint('HAS', sorted(os.environ.items()), file=sys.stderr)\n"
    tree.package({"setup.py": f"{told}{SETUP_PY}"})
    build = build_of(prepared(tree, real_ros))
    assert build.succeeded
    assert "HAS" in build.log
    assert "token" not in build.log
    assert "/home/grader" not in build.log


class Starving(OwnTime):
    """The clock of a program that gets no CPU."""

    def look(self, usages: Sequence[Usage], late_s: float) -> None:
        self.wall_s += 10_000


def test_a_build_without_cpu_is_repeated_alone_and_then_not_graded(
    tree: Tree, real_ros: RosInstallation, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree.package()
    cache = tree.root.parent / "cache"
    places: list[bool] = []

    def place(alone: bool) -> nullcontext[None]:
        places.append(alone)
        return nullcontext()

    monkeypatch.setattr("grader.submission.build.bounded.OwnTime", Starving)
    with pytest.raises(GraderFault, match="this machine has too little time"):
        prepare(tree.root, Preparation(ros=real_ros, cache=cache, place=place))
    assert places == [False, True]
    assert list(cache.rglob("build.json")) == []


@pytest.mark.compiles
@pytest.mark.slow
def test_what_was_built_before_another_package_hangs_counts(
    tree: Tree, real_ros: RosInstallation
) -> None:
    tree.write(INTERFACES)
    tree.package({"setup.py": f"import time\ntime.sleep(900)\n{SETUP_PY}"})
    limits = BuildLimits(other_s=20.0)
    found = prepare(
        tree.root, Preparation(ros=real_ros, cache=tree.root.parent / "cache", limits=limits)
    )
    build = build_of(found)
    assert (build.timed_out, build.failed_packages) == (True, ("bot_publisher",)), build.log
    interface = {"interface": "bot_msgs/msg/Bot"}
    assert judge("interface.generated", found.record, **interface).status is Status.PASSED


@pytest.mark.parametrize("kills", [2, 1])
def test_a_setup_py_that_the_kernel_ends_for_want_of_memory_is_no_fault_of_the_student(
    tree: Tree, real_ros: RosInstallation, monkeypatch: pytest.MonkeyPatch, kills: int
) -> None:
    tree.package({"setup.py": f"import os\nos.kill(os.getpid(), 9)\n{SETUP_PY}"})
    counted = iter([1, kills, 1, 1])
    monkeypatch.setattr("grader.submission.build.build.oom_kills", counted.__next__)
    if kills == 1:
        assert not build_of(prepared(tree, real_ros)).succeeded
        return
    with pytest.raises(GraderFault, match="this machine ran out of memory"):
        prepared(tree, real_ros)


def test_a_colcon_that_is_killed_is_no_fault_of_the_student(
    tree: Tree, real_ros: RosInstallation
) -> None:
    tree.package({"setup.py": f"import os\nos.kill(os.getppid(), 9)\n{SETUP_PY}"})
    with pytest.raises(GraderFault, match="ended in the middle of a build"):
        prepared(tree, real_ros)


@pytest.mark.parametrize("status", [1])
def test_a_colcon_that_never_says_how_a_package_ended_is_no_fault_of_the_student(
    tree: Tree, real_ros: RosInstallation, tmp_path: Path, status: int
) -> None:
    tree.package()
    python = tmp_path / "bin/python"
    python.parent.mkdir()
    python.symlink_to(real_ros.python)
    python.with_name("colcon").write_text(
        f"import sys\nprint('Starting >>> bot_publisher')\nsys.exit({status})\n"
    )
    with pytest.raises(GraderFault, match=rf"in the middle of a build \(status {status}\)"):
        prepared(tree, replace(real_ros, python=python))


LAST_WORDS = """\
import atexit, sys
atexit.register(lambda: print({!r}, end='', flush=True, file=sys.stderr))
"""


def test_last_words_without_a_line_end_cost_nothing(tree: Tree, real_ros: RosInstallation) -> None:
    tree.package({"setup.py": f"{LAST_WORDS.format('done')}{SETUP_PY}"})
    found = prepared(tree, real_ros)
    assert build_of(found).succeeded, build_of(found).log
    assert package_of(found).executables == ("bot_pub",)


@pytest.mark.parametrize("words", ["done", "Finished <<< bot_publisher\n" + "x" * 5000])
def test_a_failure_is_not_hidden_by_last_words_without_a_line_end(
    tree: Tree, real_ros: RosInstallation, words: str
) -> None:
    leave = "if 'install' in sys.argv: sys.exit(1)\n"
    tree.package({"setup.py": f"{LAST_WORDS.format(words)}{leave}{SETUP_PY}"})
    assert build_of(prepared(tree, real_ros)).failed_packages == ("bot_publisher",)


def test_a_sandbox_that_does_not_start_is_no_fault_of_the_student(
    tree: Tree,
    real_ros: RosInstallation,
    cache: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bwrap = tmp_path / "bin/bwrap"
    bwrap.parent.mkdir()
    bwrap.write_text("#!/bin/sh\necho bwrap: Creating new namespace failed >&2\nexit 1\n")
    bwrap.chmod(0o755)
    tree.package()
    builds = tree.root.parent / "cache"
    with monkeypatch.context() as patched:
        patched.setenv("PATH", f"{bwrap.parent}:{os.environ['PATH']}")
        with pytest.raises(GraderFault, match="sandbox of the build could not be started"):
            prepare(tree.root, Preparation(ros=real_ros, cache=builds, sandbox=Sandbox(cache)))
    assert list(builds.rglob("build.json")) == []


def test_a_package_of_jazzy_that_is_not_installed_keeps_only_what_rests_on_it(
    tree: Tree, real_ros: RosInstallation
) -> None:
    lacking = "nav2_msgs"
    if lacking in real_ros.packages:
        return
    cmake = "cmake_minimum_required(VERSION 3.8)\nproject(bot_msgs LANGUAGES NONE)\n"
    rests = MANIFEST.replace("bot_publisher", "rests").replace("rclpy", "bot_msgs")
    tree.package()
    tree.package({"package.xml": rests}, "src/rests")
    tree.write(
        {**INTERFACES, "src/bot_msgs/CMakeLists.txt": f"{cmake}find_package({lacking} REQUIRED)\n"}
    )
    found = prepared(tree, real_ros)
    build = build_of(found)
    assert build.failed_packages == ("bot_msgs", "rests")
    assert build.lacking == (lacking,)
    assert package_of(found).executables == ("bot_pub",)
    for name in build.failed_packages:
        cause = why_not_built(found.record, name)
        assert cause is not None and cause.status is Status.ERROR


COMPILERS = """\
cmake_minimum_required(VERSION 3.8)
project(bot_msgs LANGUAGES NONE)
foreach(number RANGE 1 6)
  add_custom_target(part_${number} ALL COMMAND mkdir ${CMAKE_BINARY_DIR}/open.${number}
    COMMAND sleep 0.2 COMMAND ls ${CMAKE_BINARY_DIR} | grep -c open.
    COMMAND rmdir ${CMAKE_BINARY_DIR}/open.${number})
endforeach()
find_package(ament_cmake REQUIRED)
ament_package()
"""


@pytest.mark.compiles
@pytest.mark.parametrize("most", [1, 2])
def test_as_many_files_are_compiled_at_once_as_there_is_memory_for(
    tree: Tree, real_ros: RosInstallation, most: int
) -> None:
    manifest = INTERFACES["src/bot_msgs/package.xml"]
    tree.write({"src/bot_msgs/package.xml": manifest, "src/bot_msgs/CMakeLists.txt": COMPILERS})
    limits = BuildLimits(room=replace(BUILD, memory_bytes=most * 2**30))
    found = prepare(
        tree.root, Preparation(ros=real_ros, cache=tree.root.parent / "cache", limits=limits)
    )
    build = build_of(found)
    assert build.succeeded, build.log
    numbers = [int(line) for line in build.log.splitlines() if line.isdecimal()]
    assert len(numbers) == 6 and max(numbers) == min(most, len(os.sched_getaffinity(0)))


@pytest.mark.parametrize(("gib", "builds"), [(1, 1), (4, 1), (8, 3), (64, 28)])
def test_as_many_builds_compile_at_once_as_there_is_memory_for(gib: int, builds: int) -> None:
    assert builds_at_once(gib * 2**30, BUILD.memory_bytes) == builds


def test_without_colcon_the_text_says_how_to_get_it(tree: Tree, named_ros: RosInstallation) -> None:
    tree.package()
    with pytest.raises(GraderFault, match="colcon is not installed"):
        prepare(tree.root, Preparation(ros=named_ros, cache=tree.root.parent / "cache"))


def test_a_build_depends_on_the_submission_and_the_installation(
    named_ros: RosInstallation,
) -> None:
    def key(sha256: str, ros: RosInstallation = named_ros) -> str:
        return build_key(sha256, ros, BuildLimits(), None, False)

    first = key("0")
    assert key("0") == first
    assert key("1") != first
    index = named_ros.prefixes[0] / "share/ament_index/resource_index/packages"
    (index / "std_msgs").unlink()
    again = RosInstallation(named_ros.source, named_ros.python, named_ros.prefixes)
    assert key("0", again) != first


READY = "ready to be killed"
WAITS = f"""\
import sys, time
if 'install' in sys.argv:
    print({READY!r}, flush=True)
    time.sleep(1)
{SETUP_PY}"""


@pytest.mark.slow
@pytest.mark.parametrize("enclosed", [True, False])
@pytest.mark.parametrize(
    ("target", "times", "graded"),
    [("runpy", 1, True), ("runpy", 9, False), ("setup.py", 1, True)],
)
def test_a_build_that_is_killed_from_outside_is_built_again_and_never_kept(
    tree: Tree,
    real_ros: RosInstallation,
    cache: Path,
    enclosed: bool,
    target: str,
    times: int,
    graded: bool,
) -> None:
    if enclosed and try_sandbox().problem:
        pytest.skip("no sandbox on this machine")
    tree.package({"setup.py": WAITS})
    builds = tree.root.parent / "cache"
    killed: list[int] = []

    def kill(line: str) -> None:
        if READY not in line or len(killed) == times:
            return
        commands = descendants(os.getpid()).items()
        found = [pid for pid, command in commands if target in command and "bwrap" not in command]
        pid = max(found)
        killed.append(pid)
        os.kill(pid, signal.SIGKILL)

    def graded_now() -> Prepared:
        sandbox = Sandbox(cache) if enclosed else None
        return prepare(
            tree.root, Preparation(ros=real_ros, cache=builds, sandbox=sandbox, on_output=kill)
        )

    if graded:
        build = build_of(graded_now())
        assert (build.succeeded, build.cached, len(killed)) == (True, False, 1)
        return
    with pytest.raises(GraderFault, match="ended in the middle of a build"):
        graded_now()
    assert len(killed) == 2
    assert list(builds.rglob("build.json")) == []


def test_the_students_own_tests_run_with_what_was_built(
    tree: Tree, real_ros: RosInstallation
) -> None:
    tests = f"{FOLDER}/test"
    tree.package()
    tree.write(
        {
            f"{tests}/test_flake8.py": "from ament_flake8.main import main_with_errors\n",
            f"{tests}/test_node.py": "from bot_publisher import node\n\n"
            "def test_right():\n    assert node.__file__\n\n"
            "def test_wrong():\n    assert 1 == 2\n",
        }
    )
    cache = tree.root.parent / "cache"
    record = prepare(
        tree.root,
        Preparation(
            ros=real_ros, cache=cache, choose_tested=lambda _: frozenset({"bot_publisher"})
        ),
    ).record.build
    assert record is not None
    [run] = record.tests
    assert (run.passed, run.problem) == (1, None)
    assert run.failed == (("test/test_node.py::test_wrong", "assert 1 == 2"),)
