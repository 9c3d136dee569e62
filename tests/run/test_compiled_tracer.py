from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from grader.machine import ros
from grader.run.compiled_tracer import compiled_tracer, has_compiled_programs

_PRINTS = """
#include <cstdio>
#include <cstdlib>
#include <iostream>
int main() { std::printf("one\\n"); std::cout << "two\\n"; std::_Exit(0); }
"""
_CRASH = """
#include <stdexcept>
void decide(bool fails) { if (fails) throw std::runtime_error("no idea"); }
int main() { decide(true); }
"""


def test_it_is_built_once_for_a_ros_installation(tmp_path: Path) -> None:
    first = compiled_tracer(ros.find(), tmp_path)
    assert first is not None
    built = first.stat().st_mtime_ns
    assert compiled_tracer(ros.find(), tmp_path) == first
    assert first.stat().st_mtime_ns == built


def test_without_a_compiler_there_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert compiled_tracer(ros.find(), tmp_path) is None


def test_scripts_are_no_compiled_programs(tmp_path: Path) -> None:
    folder = tmp_path / "lib" / "bot_publisher"
    folder.mkdir(parents=True)
    (folder / "bot_pub").write_text("#!/usr/bin/python3\n", encoding="utf-8")
    (folder / "bot_pub").chmod(0o755)
    assert not has_compiled_programs(tmp_path)
    shutil.copy("/bin/true", folder / "other")
    assert has_compiled_programs(tmp_path)


def _run_traced(source: str, tmp_path: Path) -> subprocess.CompletedProcess[str]:
    library = compiled_tracer(ros.find(), tmp_path)
    (tmp_path / "crash.cpp").write_text(source, encoding="utf-8")
    command = ["c++", "-g", "-O0", "crash.cpp", "-o", "crash"]
    subprocess.run(command, cwd=tmp_path, check=True)
    read, write = os.pipe()
    with os.fdopen(read), os.fdopen(write, "wb"):
        return subprocess.run(
            [tmp_path / "crash"],
            env={
                "LD_PRELOAD": str(library),
                "ROSGRADE_TRACER_FD": str(write),
                "ROSGRADE_TRACER_PIPE": str(os.fstat(write).st_ino),
            },
            pass_fds=(write,),
            capture_output=True,
            text=True,
            check=False,
        )


def test_what_is_printed_is_there_at_once_as_in_a_terminal(tmp_path: Path) -> None:
    """To a pipe it would come when a buffer of 4 KiB is full, or when the program ends."""
    assert _run_traced(_PRINTS, tmp_path).stdout == "one\ntwo\n"


def test_the_function_that_crashes_is_named_with_file_and_line(tmp_path: Path) -> None:
    run = _run_traced(_CRASH, tmp_path)
    assert run.returncode == -6
    lines = run.stderr.splitlines()
    assert "rosgrade: SIGABRT (abort) in crash" in lines
    frames = lines[lines.index("rosgrade: SIGABRT (abort) in crash") + 1 :]
    assert frames[0].startswith("rosgrade:   #0 decide(bool) at ")
    assert frames[0].endswith("crash.cpp:3")
