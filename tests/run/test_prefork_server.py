"""The process that forks cells: it may end at any time, and no cell inherits what it holds."""

from __future__ import annotations

import os
import select
import shutil
import signal
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from grader.errors import GraderFault
from grader.machine import ros
from grader.machine.resources import BUILDS, INSTALL, UNDERLAYS
from grader.recording.mcap_reader import read_recording
from grader.run.cell.cell_process import CellProcess
from grader.run.cell.prefork_server import PreforkServer
from grader.run.process.descendants import descendants
from grader.run.request import RunRequest
from grader.run.runner import Runner
from grader.sandbox import bubblewrap
from grader.sandbox.sandbox import Sandbox
from grader.sandbox.trial import try_sandbox
from grader.sandbox.usage import usage_of
from tests.run import nodes
from tests.run.conftest import SUBMISSION, RunNode, assignment, install

pytestmark = pytest.mark.ros


@pytest.fixture
def sandbox(cache: Path) -> Sandbox:
    found = try_sandbox()
    if found.problem:
        pytest.skip(f"no sandbox on this machine: {found.problem}; {found.remedy}")
    return Sandbox(cache)


def prefork_servers() -> set[int]:
    """The prefork servers among this process's children; their forks are their own children."""
    return {
        pid
        for pid, command in descendants(os.getpid()).items()
        if "grader.run.cell.prefork_process" in command
        and f"PPid:\t{os.getpid()}\n" in Path(f"/proc/{pid}/status").read_text()
    }


def process_of(cell: CellProcess, prefork_server: PreforkServer) -> int:
    cell.await_fork()
    usages = usage_of([prefork_server._popen.pid])
    (found,) = {usage.pid for usage in usages} - {usage.parent for usage in usages}
    return found


def test_a_run_whose_prefork_server_is_killed_is_a_fault_and_the_next_one_is_not(
    tmp_path: Path,
) -> None:
    course = assignment(until={"messages": 3})
    scenario = course.scenarios[0]
    space = install(tmp_path, nodes.timed())
    before = prefork_servers()

    def kill(_scenario: str, event: object) -> None:
        if isinstance(event, dict) and event["event"] == "launching":
            (own,) = prefork_servers() - before
            os.kill(own, signal.SIGKILL)

    with Runner(ros.find(), progress=kill) as runner:
        file = tmp_path / "run.mcap"
        with pytest.raises(GraderFault, match=r"'run' ended with status -9 \(it was killed, or"):
            runner.run(RunRequest(course, scenario, SUBMISSION, space, 1), file)
        runner.progress = lambda _scenario, _event: None
        runner.run(RunRequest(course, scenario, SUBMISSION, space, 1), file)
        assert len(read_recording(file).on("/cmd_vel")) >= 3


@pytest.mark.parametrize("boxed", [False, True])
def test_the_end_does_not_wait_for_a_cell_that_hangs(boxed: bool, sandbox: Sandbox) -> None:
    prefork_server = PreforkServer(ros.find(), sandbox if boxed else None)
    cell = CellProcess(prefork_server)
    hung = process_of(cell, prefork_server)
    its_end = os.pidfd_open(hung)
    os.kill(hung, signal.SIGSTOP)
    prefork_server.close(limit_s=0.1)
    cell.close()
    assert select.select([its_end], [], [], 10.0)[0]
    os.close(its_end)
    assert not prefork_server.cells.exists()


@pytest.mark.slow
def test_a_cell_that_hangs_does_not_long_outlive_its_grader() -> None:
    prefork_server = PreforkServer(ros.find())
    cell = CellProcess(prefork_server)
    hung = process_of(cell, prefork_server)
    os.kill(hung, signal.SIGSTOP)
    # What the kernel does for a grader that is killed.
    prefork_server._socket.close()
    assert prefork_server._popen.wait(45.0) == 0
    assert not Path(f"/proc/{hung}").exists()
    cell.close()
    prefork_server.close()


def test_no_cell_is_made_where_files_of_the_students_python_were_deleted(
    sandbox: Sandbox,
) -> None:
    prefork_server = PreforkServer(ros.find(), sandbox)
    check = sandbox.watched()
    check()
    assert prefork_server.is_usable
    next(sandbox.python_tree.glob("lib/python3*/site-packages/rclpy/node.py")).unlink()
    with pytest.raises(GraderFault, match="files of the sandbox's Python were deleted"):
        check()
    assert not prefork_server.is_usable
    prefork_server.close()


def test_the_installation_of_a_package_meanwhile_spoils_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sandbox: Sandbox
) -> None:
    course = assignment(until={"messages": 3})
    space = install(tmp_path, nodes.timed())
    # Not below /tmp, where a sandbox has its own.
    with tempfile.TemporaryDirectory(dir="/var/tmp") as etc:
        linker_cache = Path(etc, "ld.so.cache")
        linker_cache.write_bytes(b"old")
        Path(etc).chmod(0o755)
        monkeypatch.setattr(bubblewrap, "_SYSTEM_FILES", (str(linker_cache),))
        with Runner(ros.find(), sandbox=sandbox) as runner:
            for name in ("before", "after"):
                file = tmp_path / f"{name}.mcap"
                runner.run(RunRequest(course, course.scenarios[0], SUBMISSION, space, 1), file)
                assert len(read_recording(file).on("/cmd_vel")) >= 3
                # As ldconfig does it at the end of every installation.
                new = Path(etc, "ld.so.cache~")
                new.write_bytes(b"new")
                new.replace(linker_cache)


def test_an_underlay_is_shown_to_each_run_and_copied_for_none_also_one_that_is_added_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sandbox: Sandbox
) -> None:
    copied: list[str] = []
    copy = shutil.copytree

    def watched(source: Path, *others: Any, **options: Any) -> Any:
        copied.append(os.fspath(source))
        return copy(source, *others, **options)

    course = assignment(until={"messages": 3})
    space = install(tmp_path, "import first_module\n" + nodes.timed())
    monkeypatch.setattr(shutil, "copytree", watched)
    kept = sandbox.cache / UNDERLAYS / BUILDS
    with Runner(ros.find(), sandbox=sandbox) as runner:
        underlays: tuple[Path, ...] = ()
        for name in ("first", "second"):
            underlays = (*underlays, kept / name / INSTALL)
            site = underlays[-1] / f"lib/python3.{sys.version_info[1]}/site-packages"
            site.mkdir(parents=True)
            (site / f"{name}_module.py").write_text("import os; assert os.path.exists(__file__)\n")
            file = tmp_path / f"{name}.mcap"
            wanted = RunRequest(course, course.scenarios[0], SUBMISSION, space, 1)
            runner.run(replace(wanted, underlays=underlays), file)
            assert len(read_recording(file).on("/cmd_vel")) >= 3
    assert str(space) in copied
    assert not [path for path in copied if path.startswith(str(kept))]


def test_a_student_inherits_no_descriptor_but_its_own(run_node: RunNode) -> None:
    listing = (
        "import os\n"
        "for fd in os.listdir('/proc/self/fd'):\n"
        "    try: print('holds', fd, os.readlink(f'/proc/self/fd/{fd}'))\n"
        "    except OSError: pass\n"
    )
    recording = run_node(listing + nodes.ONE_SHOT, until={"quiet": "300 ms"})
    held = [line.text.split()[1:] for line in recording.log if line.text.startswith("holds ")]
    standard = [target for fd, target in held if int(fd) <= 2]
    others = [target for fd, target in held if int(fd) > 2]
    assert standard[0] == "/dev/null"
    # The tracer's three pipes, and nothing of the prefork server's or of another cell's.
    assert len([target for target in others if target.startswith("pipe:")]) == 3
    assert not [target for target in others if target.startswith("socket:")]


def test_a_cell_imports_nothing_of_the_folder_in_which_the_command_was_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "grader").mkdir()
    (tmp_path / "grader" / "__init__.py").write_text("raise SystemExit('not ours')\n")
    monkeypatch.chdir(tmp_path)
    prefork_server = PreforkServer(ros.find())
    cell = CellProcess(prefork_server)
    assert process_of(cell, prefork_server)
    cell.close()
    prefork_server.close()
