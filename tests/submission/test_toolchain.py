"""A machine without a compiler says what to install; it is not the student's fault."""

from __future__ import annotations

import sysconfig
from pathlib import Path

import pytest

from grader.errors import GraderFault
from grader.submission.toolchain import check_headers, check_toolchain


def _install(folder: Path, *tools: str) -> str:
    for tool in tools:
        (folder / tool).write_text("#!/bin/sh\n")
        (folder / tool).chmod(0o755)
    return str(folder)


def test_what_is_missing_is_named_as_the_packages_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(GraderFault, match=r"cannot compile: sudo apt install cmake g\+\+$"):
        check_toolchain(_install(tmp_path, "make"))


def test_a_machine_with_all_tools_may_build(tmp_path: Path) -> None:
    check_toolchain(_install(tmp_path, "make", "cmake", "c++"))


NO_HEADERS = "Could NOT find Python3 (missing: Python3_INCLUDE_DIRS Development.Module NumPy)"


def test_missing_headers_of_python_are_named_as_a_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path))
    with pytest.raises(GraderFault, match=r"sudo apt install python3\.\d+-dev$"):
        check_headers(NO_HEADERS)
    check_headers("error: expected ‘;’ before ‘}’ token")


def test_headers_that_are_there_are_not_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "Python.h").touch()
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path))
    check_headers(NO_HEADERS)
