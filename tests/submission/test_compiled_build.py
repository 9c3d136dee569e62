"""Packages in C++ are built as students need it: errors with their line, programs with lines."""

from __future__ import annotations

import subprocess
from dataclasses import replace

import pytest

from grader.findings.finding import Finding
from grader.machine.ros import RosInstallation
from grader.sandbox.limits import BUILD, MIB
from grader.sandbox.sandbox import Sandbox
from grader.sandbox.trial import try_sandbox
from grader.submission.build.colcon import BuildLimits
from grader.submission.prepare import Preparation, Prepared, prepare
from tests.checks.builder import judge
from tests.submission.samples import MANIFEST, Tree

pytestmark = [pytest.mark.ros]

FOLDER = "src/bot_publisher"
CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project(bot_publisher)
find_package(ament_cmake REQUIRED)
find_package(rcutils REQUIRED)
add_executable(bot_pub src/bot.cpp)
ament_target_dependencies(bot_pub rcutils)
install(TARGETS bot_pub DESTINATION lib/${PROJECT_NAME})
ament_package()
"""
CODE = """\
#include <rcutils/logging.h>
#include <cstdio>

void drive()
{
  (void)rcutils_logging_initialize();
  std::puts(__FILE__);
}

int main()
{
  drive();
}
"""


def built(
    tree: Tree, ros: RosInstallation, changes: dict[str, str] | None = None, memory_mib: int = 0
) -> Prepared:
    manifest = MANIFEST.replace("ament_python", "ament_cmake").replace(
        "<depend>rclpy</depend>", "<depend>rcutils</depend>"
    )
    files = {"package.xml": manifest, "CMakeLists.txt": CMAKE, "src/bot.cpp": CODE}
    tree.write({f"{FOLDER}/{name}": text for name, text in {**files, **(changes or {})}.items()})
    cache = tree.root.parent / "cache"
    if not memory_mib:
        return prepare(tree.root, Preparation(ros=ros, cache=cache))
    limits = BuildLimits(room=replace(BUILD, memory_bytes=memory_mib * MIB))
    return prepare(
        tree.root, Preparation(ros=ros, cache=cache, limits=limits, sandbox=Sandbox(cache))
    )


def judged(found: Prepared, check: str = "package.builds") -> Finding:
    parameters = {"executable": "bot_pub"} if check == "package.executable" else {}
    return judge(check, found.record, package="bot_publisher", **parameters)


def test_a_program_names_its_lines_by_the_files_as_handed_in(
    tree: Tree, real_ros: RosInstallation
) -> None:
    found = built(tree, real_ros)
    assert found.install is not None, found.record.build
    program = str(found.install / "lib/bot_publisher/bot_pub")
    symbols = subprocess.check_output(["nm", "-C", program], text=True).splitlines()
    address = next(line.split()[0] for line in symbols if line.endswith(" drive()"))
    place = subprocess.check_output(["addr2line", "-e", program, address], text=True)
    assert place.strip() == f"{FOLDER}/src/bot.cpp:5"
    overlaid = real_ros.environment({}, (found.install,))
    assert subprocess.check_output([program], text=True, env=overlaid).strip().endswith("bot.cpp")
    assert judged(found, "package.dependencies").observed == "`rcutils` declared"


@pytest.mark.parametrize(
    ("changes", "seen", "hint"),
    [
        (
            {"src/bot.cpp": CODE.replace("puts(__FILE__);", "puts(__FILE__)")},
            FOLDER + "/src/bot.cpp:7: expected ‘;’ before ‘}’ token",
            "the one before it",
        ),
        (
            {"src/bot.cpp": CODE.replace("void drive()\n{", "void drive();\nvoid other()\n{")},
            f"{FOLDER}/src/bot.cpp:13: undefined reference to `drive()'",
            "`drive()` is declared and called, but its body is not found",
        ),
        (
            {"CMakeLists.txt": CMAKE.replace("find_package(rcutils REQUIRED)\n", "")},
            f"{FOLDER}/CMakeLists.txt:5: ament_target_dependencies() the passed package name",
            "find_package(rcutils REQUIRED)",
        ),
        (
            {"CMakeLists.txt": CMAKE.replace("ament_target_dependencies(bot_pub rcutils)\n", "")},
            f"{FOLDER}/src/bot.cpp:1: rcutils/logging.h: No such file",
            "ament_target_dependencies(<program> rcutils)",
        ),
    ],
)
def test_the_first_error_of_a_compiler_is_explained(
    tree: Tree, real_ros: RosInstallation, changes: dict[str, str], seen: str, hint: str
) -> None:
    finding = judged(built(tree, real_ros, changes))
    assert seen in finding.observed
    assert hint in finding.hint
    assert not any(line.startswith("--") for line in finding.evidence.log)


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        (
            "install(TARGETS bot_pub DESTINATION lib/${PROJECT_NAME})",
            "",
            "the build installed no executable",
        ),
        ("lib/${PROJECT_NAME}", "bin", "was installed in bin/"),
        ("ament_package()\n", "", "ROS does not find the package"),
    ],
)
def test_what_ros2_run_does_not_find_is_explained(
    tree: Tree, real_ros: RosInstallation, right: str, wrong: str, words: str
) -> None:
    found = built(tree, real_ros, {"CMakeLists.txt": CMAKE.replace(right, wrong)})
    assert words in judged(found, "package.executable").observed


@pytest.mark.skipif(bool(try_sandbox().problem), reason="no sandbox on this machine")
def test_a_compiler_that_takes_all_memory_is_ended_at_its_file(
    tree: Tree, real_ros: RosInstallation
) -> None:
    bomb = """\
template<int N, int M> struct A { static const long v = A<N-1, 2*M>::v + A<N-1, 2*M+1>::v; };
template<int M> struct A<0, M> { static const long v = M; };
int main() { return A<24, 0>::v; }
"""
    finding = judged(built(tree, real_ros, {"src/bot.cpp": bomb}, memory_mib=300))
    assert f"{FOLDER}/src/bot.cpp: the build was ended because it took more" in finding.observed
    assert "templates that use themselves" in finding.hint
