"""A machine without a compiler says what to install; it is not the student's fault."""

from __future__ import annotations

import sysconfig
from pathlib import Path

import pytest

from grader.errors import GraderFault
from grader.submission.build.build_log import not_found
from grader.submission.build.toolchain import check_toolchain, missing_here


def _install(folder: Path, *tools: str) -> str:
    for tool in tools:
        (folder / tool).write_text("#!/bin/sh\n")
        (folder / tool).chmod(0o755)
    return str(folder)


def test_what_is_missing_is_named_as_the_packages_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(GraderFault, match=r"tools are missing: sudo apt install cmake g\+\+$"):
        check_toolchain(_install(tmp_path, "make"))


def test_a_machine_with_all_tools_may_build(tmp_path: Path) -> None:
    check_toolchain(_install(tmp_path, "make", "cmake", "c++"))


NO_HEADERS = not_found("Could NOT find Python3 (missing: Python3_INCLUDE_DIRS Development.Module)")


@pytest.mark.parametrize("there", [True, False])
def test_headers_of_python_are_lacking_only_where_they_are_not_installed(
    there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if there:
        (tmp_path / "Python.h").touch()
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path))
    assert missing_here(NO_HEADERS) == (set() if there else {"python3-dev"})


def test_only_a_library_that_rosdep_installs_can_be_lacking() -> None:
    wanted = not_found(
        'provided by\n  "Ceres" with\nCould not find a package configuration file provided by\n'
        '"Eigen3_" with any\nCould NOT find Armadillo (missing: ARMADILLO_INCLUDE_DIR)'
    )
    assert wanted == {"Eigen3_", "Armadillo"}
    assert missing_here(wanted) <= {"Armadillo"}
