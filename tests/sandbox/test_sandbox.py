"""What the sandbox is made of: command lines, the filter, the student's Python, the choice."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from grader.errors import GraderFault
from grader.machine import ros
from grader.sandbox import bubblewrap, python_tree, sandbox, trial
from grader.sandbox.bubblewrap import Bind
from grader.sandbox.choice import Choice
from grader.sandbox.python_tree import check_installed, prune, student_prefix, unlisted
from grader.sandbox.sandbox import Sandbox, hide
from grader.sandbox.seccomp import student_filter
from grader.sandbox.trial import Trial, choose


def test_root_goes_on_as_nobody_before_bubblewrap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    command = bubblewrap.launch(["--x"], [Bind.same(Path("/root/a"))], [], ["true"])
    assert command.index("unshare") < command.index("setpriv") < command.index("--x")
    assert "--reuid=61000" in command and "--no-new-privs" in command
    assert command[-5:] == ["--ro-bind", "/run/rosgrade/0", "/root/a", "--", "true"]


def test_rosgrade_s_code_is_covered_where_it_would_be_shown() -> None:
    import grader

    code = Path(grader.__file__).resolve().parent
    assert str(code) in hide([Bind.same(code.parent)])
    assert str(code) not in hide([Bind(Path("/elsewhere"), code.parent)])


def test_assignments_are_covered_where_rosgrade_is_installed_in_its_environment(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, cache: Path
) -> None:
    data = Path(sys.prefix).resolve() / "lib"
    monkeypatch.setattr(sandbox, "_DATA", data)
    command = Sandbox(cache).server_command(["true"], ros.find(), tmp_path, {})
    covered = [command[at + 1] for at, text in enumerate(command) if text == "--tmpfs"]
    assert str(sandbox.ENVIRONMENT / "lib") in covered
    assert str(data) not in covered


def test_auto_says_in_one_line_that_there_is_no_sandbox(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    missing = Trial("bwrap is not installed", "sudo apt install bubblewrap")
    monkeypatch.setattr(trial, "try_sandbox", lambda: missing)
    chosen, notice = choose(Choice.AUTO, tmp_path)
    assert chosen is None
    assert "no sandbox (bwrap is not installed)" in notice and "\n" not in notice
    with pytest.raises(GraderFault, match="no sandbox: bwrap is not installed; sudo apt install"):
        choose(Choice.BWRAP, tmp_path)
    assert choose(Choice.NONE, tmp_path) == (None, "")


def test_a_missing_program_is_named_with_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    assert trial.try_sandbox() == Trial("bwrap is not installed", "sudo apt install bubblewrap")


def test_every_user_may_read_the_students_python_under_any_umask(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        tree = student_prefix(tmp_path)
    finally:
        os.umask(before)
    folders = [Path(folder) for folder, _, _ in os.walk(tree)]
    assert all(folder.stat().st_mode & 0o555 == 0o555 for folder in folders)
    assert all(path.stat().st_mode & 0o444 == 0o444 for path in (tree / "bin").iterdir())


def test_the_student_s_python_holds_ros_and_not_rosgrade(tmp_path: Path) -> None:
    tree = student_prefix(tmp_path)
    (site,) = tree.glob("lib/python3*/site-packages")
    there = {path.name for path in site.iterdir()}
    assert {"rclpy", "geometry_msgs", "numpy", "colcon_core"} <= there
    assert not {"pydantic", "typer", "mcap", "scipy", "_rosgrade.pth", "pyseccomp.py"} & there
    assert not (tree / "bin" / "rosgrade").exists()
    assert student_prefix(tmp_path) == tree
    assert not list(tree.parent.glob(".unfinished*"))


def test_a_python_with_deleted_files_is_noticed_and_made_anew(tmp_path: Path) -> None:
    sandbox = Sandbox(tmp_path)
    check = sandbox.watched()
    check()
    (site,) = sandbox.python_tree.glob("lib/python3*/site-packages")
    (site / "rclpy" / "node.py").unlink()
    with pytest.raises(GraderFault, match="files of the sandbox's Python were deleted"):
        check()
    # A run beside it is not blamed either, although a whole environment is there by now.
    (site,) = sandbox.python_tree.glob("lib/python3*/site-packages")
    assert (site / "rclpy" / "node.py").is_file()
    with pytest.raises(GraderFault):
        check()
    sandbox.watched()()


def test_a_damaged_python_or_filter_is_made_anew(tmp_path: Path) -> None:
    sandbox = Sandbox(tmp_path)
    damaged = next(sandbox.python_tree.glob("lib/python3*/site-packages/rclpy/node.py"))
    whole = damaged.read_bytes()
    # As a file of its own: rosgrade's environment has the same by a hard link.
    damaged.unlink()
    damaged.write_bytes(bytes(len(whole)))
    file = sandbox.filter_file(b"a program")
    file.write_bytes(b"12345 789")
    assert Sandbox(tmp_path).filter_file(b"a program").read_bytes() == b"a program"
    (found,) = Sandbox(tmp_path).python_tree.glob("lib/python3*/site-packages/rclpy/node.py")
    assert found.read_bytes() == whole


def test_a_library_that_the_assignment_allows_is_there(cache: Path) -> None:
    sandbox = Sandbox(cache).allowing(("SciPy",))
    (site,) = sandbox.python_tree.glob("lib/python3*/site-packages")
    assert (site / "scipy").is_dir()
    assert sandbox.allowing(("SciPy",)) is sandbox
    assert sandbox.allowing(()).python_tree != sandbox.python_tree


def test_a_library_that_is_not_installed_is_named_with_the_way_to_get_it() -> None:
    with pytest.raises(GraderFault, match=r"'scypi', which is not installed here. Did you mean "):
        check_installed(["numpy", "scypi"])
    with pytest.raises(GraderFault, match="-m pip install no-such-library-at-all"):
        check_installed(["no-such-library-at-all"])


def trees(folder: Path, ages_s: dict[str, float]) -> None:
    now_s = time.time()
    for name, age_s in ages_s.items():
        (folder / name / "lib").mkdir(parents=True)
        os.utime(folder / name, (now_s - age_s, now_s - age_s))


def test_what_only_rosgrade_needs_is_distinguished_from_what_a_student_may_import() -> None:
    modules = ["jinja2", "scipy", "numpy", "math", "yaml", "rclpy", "nobody_has_this"]
    assert unlisted(modules, ()) == ("jinja2", "scipy")
    assert unlisted(modules, ("SciPy",)) == ("jinja2",)


def test_the_system_s_libraries_are_told_apart_from_rosgrade_s(tmp_path: Path, monkeypatch) -> None:
    about = tmp_path / "zq_system-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: zq-system\nVersion: 1.0\n")
    (about / "top_level.txt").write_text("zq_system\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert unlisted(["jinja2", "zq_system"], (), tmp_path) == ("zq_system",)
    assert unlisted(["jinja2", "zq_system"], ("zq_system",), tmp_path) == ()


def test_a_library_under_the_name_that_ubuntu_has_is_the_library(monkeypatch) -> None:
    monkeypatch.setattr(python_tree, "_installed", lambda: {"lark": None})
    check_installed(["lark-parser"])


def test_what_was_not_used_for_a_month_is_thrown_away(tmp_path: Path) -> None:
    day_s = 24 * 3600
    ages = {"a": 10, "b": 29 * day_s, "c": 31 * day_s, ".unfinished-x": 10**8}
    trees(tmp_path, ages)
    (tmp_path / "c.files").touch()
    os.utime(tmp_path / "c.files", (0, 0))
    prune(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"a", "b"}


def test_a_build_room_writes_only_where_it_may(tmp_path: Path, cache: Path) -> None:
    found = trial.try_sandbox()
    if found.problem:
        pytest.skip(f"no sandbox on this machine: {found.problem}; {found.remedy}")
    folder = tmp_path / "room"
    folder.mkdir()
    script = "; ".join(
        f"(echo x > {path}) 2>/dev/null && echo {path}"
        for path in (folder / "file", "/tmp/file", "/usr/file", "/etc/file", "/file", "/dev/file")
    )
    with Sandbox(cache).build(ros.find(), (folder,)) as room:
        ended = subprocess.run(
            room.command(["/bin/sh", "-c", script + "; id -u; echo $SECRET"], {"PATH": "/usr/bin"}),
            env={**room.environment, "SECRET": "secret"},
            capture_output=True,
            text=True,
            check=False,
        )
    assert ended.stdout.split() == [str(folder / "file"), "/tmp/file", "1000"], ended.stderr
    assert (folder / "file").read_text() == "x\n"
    assert (folder / "file").stat().st_uid == os.getuid()
    assert not Path("/tmp/file").exists()


def test_the_filter_refuses_and_pretends(tmp_path: Path) -> None:
    """Loaded into a process of its own, without any namespace around it."""
    pytest.importorskip("pyseccomp")
    program = tmp_path / "program.py"
    program.write_text(
        "import ctypes, os, socket, struct, sys\n"
        "code = open(sys.argv[1], 'rb').read()\n"
        "buffer = ctypes.create_string_buffer(code)\n"
        "class Prog(ctypes.Structure):\n"
        "    _fields_ = [('n', ctypes.c_ushort), ('code', ctypes.c_void_p)]\n"
        "prog = Prog(len(code) // 8, ctypes.addressof(buffer))\n"
        "libc = ctypes.CDLL(None, use_errno=True)\n"
        "assert libc.prctl(38, 1, 0, 0, 0) == 0\n"
        "assert libc.prctl(22, 2, ctypes.byref(prog), 0, 0) == 0\n"
        "def refused(call):\n"
        "    try:\n        call()\n    except OSError as error:\n        return error.errno == 1\n"
        "before = os.sched_getaffinity(0)\n"
        "os.sched_setaffinity(0, {min(before)})\n"
        "print(os.sched_getaffinity(0) == before)\n"
        "print(refused(lambda: socket.socket(40)), refused(lambda: os.memfd_create('x')))\n"
        "socket.socket().close(); socket.socketpair()[0].close(); os.setsid\n"
        "print(os.waitpid(os.posix_spawn('/bin/true', ['true'], {}), 0)[1])\n"
    )
    filter_file = Sandbox(tmp_path).filter_file(student_filter(guarded=True))
    said = subprocess.run(
        [sys.executable, "-S", "-W", "ignore", str(program), str(filter_file)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert said.stdout.split() == ["True", "True", "True", "0"], said.stderr


def test_no_two_builds_and_no_run_are_one_user_where_we_are_root(
    tmp_path: Path, cache: Path
) -> None:
    sandbox, installation = Sandbox(cache), ros.find()
    folders = [tmp_path / "one", tmp_path / "other"]
    for folder in folders:
        folder.mkdir()
    with (
        sandbox.build(installation, folders[:1]) as one,
        sandbox.build(installation, folders[1:]) as other,
    ):
        assert len({one.uid, other.uid, bubblewrap.UID}) == 3
        if os.geteuid() == 0:
            assert [folder.stat().st_uid for folder in folders] == [one.uid, other.uid]
            assert f"--reuid={one.uid}" in one.command(["true"], {})
