"""A ROS installation that is not whole is the machine's fault, and named by its package."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from grader.diagnosis.not_built import why_not_built
from grader.findings.finding import Status
from grader.machine.ros import RosInstallation
from grader.submission.build.ros_damage import damaged
from grader.submission.prepare import Preparation, Prepared, prepare
from tests.submission.samples import MANIFEST, Tree

FOLDER = "src/bot_publisher"
TARGET = 'Imported target "rclcpp::rclcpp" includes non-existent path\n\n    "{}"\n\n  in its'
NOT_READ = "CMake Error at /opt/ros/jazzy/share/rclcpp/cmake/rclcppConfig.cmake:{}:\n  {}"
HEADER = "/opt/ros/jazzy/include/rclcpp/rclcpp.hpp:3:10: fatal error: rcl/{}: No such file"
MODULE = 'File "/opt/ros/jazzy/lib/python3/site-packages/a.py", line 1, in <module>\n  import {0}\n'
EXPORT = """\
set_target_properties(rclcpp::rclcpp PROPERTIES X "${_IMPORT_PREFIX}/include/rclcpp"
  IMPORTED_LOCATION "${_IMPORT_PREFIX}/lib/librclcpp.so")
"""


@pytest.fixture
def whole(named_ros: RosInstallation) -> RosInstallation:
    """An installation with the files that the logs here name."""
    prefix = named_ros.prefixes[0]
    shutil.copy(Path(sys.executable).resolve(), prefix / "lib/librclcpp.so")
    cmake, headers = prefix / "share/rclcpp/cmake", prefix / "include/rcl/rcl"
    for folder in (cmake, headers, prefix / "include/rclcpp"):
        folder.mkdir(parents=True)
    (cmake / "rclcppExport.cmake").write_text(EXPORT)
    (cmake / "rclcppConfig.cmake").write_text('if(A)\n  include("B")\nendif()\n')
    (headers / "rcl.h").touch()
    (prefix / "include/rclcpp/rclcpp.hpp").write_text('#include "rcl/rcl.h"\n')
    (prefix / "lib/python3/site-packages").mkdir(parents=True)
    (prefix / "lib/python3/site-packages/a.py").write_text("import em_\n")
    return replace(named_ros, source="sourced")


def cut(name: str) -> Callable[[Path], None]:
    """Cut the end off a file of the installation."""

    def damage(prefix: Path) -> None:
        data = (prefix / name).read_bytes()
        (prefix / name).write_bytes(data[: len(data) // 2])

    return damage


def remove(name: str) -> Callable[[Path], None]:
    """Remove a file or a folder."""

    def damage(prefix: Path) -> None:
        shutil.rmtree(prefix / name) if (prefix / name).is_dir() else (prefix / name).unlink()

    return damage


LIBRARY, CONFIG = "lib/librclcpp.so", "share/rclcpp/cmake/rclcppConfig.cmake"


@pytest.mark.parametrize(
    ("log", "damage", "name"),
    [
        (TARGET.format("/opt/ros/jazzy/include/rclcpp"), remove("include/rclcpp"), "rclcpp"),
        (f"No rule to make target '/opt/ros/jazzy/{LIBRARY}', needed by 'x'",
         remove(LIBRARY), "rclcpp"),
        (f"ninja: error: '/opt/ros/jazzy/{LIBRARY}', needed by 'bot', missing and no known rule",
         remove(LIBRARY), "rclcpp"),
        (f"/usr/bin/ld: /opt/ros/jazzy/{LIBRARY}: file not recognized", cut(LIBRARY), "rclcpp"),
        (NOT_READ.format(1, "A logical block opening"), cut(CONFIG), "rclcpp"),
        (NOT_READ.format(2, "Parse error.  Expected"), cut(CONFIG), "rclcpp"),
        (HEADER.format("rcl.h"), remove("include/rcl"), "rcl"),
    ],
)  # fmt: skip
def test_what_is_damaged_is_named_and_what_is_only_printed_is_not(
    whole: RosInstallation, log: str, damage: Callable[[Path], None], name: str
) -> None:
    assert damaged(log, whole, ()) == set()
    damage(whole.prefixes[0])
    assert damaged(log, whole, ()) == {name}
    assert damaged(log, whole, (name,)) == set()


@pytest.mark.parametrize(
    "log",
    [
        TARGET.format("/nowhere/include/rclcpp"),
        TARGET.format("/nowhere").replace("rclcpp", "mine"),
        "No rule to make target '/home/ada/librclcpp.so', needed by 'bot'",
        "No rule to make target '/opt/ros/jazzy/lib/librclccp.so', needed by 'bot'",
        f"{MODULE.format('json')}ModuleNotFoundError: No module named 'json'",
        # Words that a build file can print: no file of ROS is there that asks for what they name.
        HEADER.format("nope.hpp"),
        HEADER.format("nope.hpp").replace("rclcpp.hpp", "nope.hpp"),
        HEADER.format("nope.hpp").replace("include/rclcpp", "../student"),
        f"{MODULE.format('nope_zz')}ModuleNotFoundError: No module named 'nope_zz'",
        f"{MODULE.format('em_')}ModuleNotFoundError: No module named 'em_'".replace("a.py", "b.py"),
        NOT_READ.format(2, "Parse error.  Expected").replace("rclcppConfig", "nope"),
        "/usr/bin/ld: /opt/ros/jazzy/lib/librclcpp__nope.so: file truncated",
        "No rule to make target '/opt/ros/jazzy/lib/librclcpp__nope.so', needed by 'bot'",
    ],
)
def test_a_students_own_path_or_words_are_no_damage(
    whole: RosInstallation, tmp_path: Path, log: str
) -> None:
    (tmp_path / "student").mkdir()
    (tmp_path / "student/rclcpp.hpp").write_text('#include "rcl/nope.hpp"\n')
    assert damaged(log, whole, ()) == set()


def test_a_module_that_ros_itself_imports_is_lacking(whole: RosInstallation) -> None:
    log = f"{MODULE.format('em_')}ModuleNotFoundError: No module named 'em_'"
    assert damaged(log, whole, ()) == {"em_"}


CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project(bot_publisher LANGUAGES C)
find_package(ament_cmake REQUIRED)
find_package(nav2_util REQUIRED)
add_executable(bot bot.c)
target_link_libraries(bot nav2_util::nav2_util)
install(TARGETS bot DESTINATION lib/${PROJECT_NAME})
ament_package()
"""
CONFIG_CMAKE = """\
add_library(nav2_util::nav2_util SHARED IMPORTED)
set_target_properties(nav2_util::nav2_util PROPERTIES IMPORTED_LOCATION
  "${nav2_util_DIR}/../../../lib/libnav2_util.so")
"""


@pytest.mark.ros
@pytest.mark.compiles
def test_a_build_that_a_damaged_package_stops_costs_nothing_and_is_not_kept(
    tree: Tree, real_ros: RosInstallation, tmp_path: Path
) -> None:
    prefix = tmp_path / "under"
    config = prefix / "share/nav2_util/cmake/nav2_utilConfig.cmake"
    index = prefix / "share/ament_index/resource_index/packages/nav2_util"
    for file, text in ((config, CONFIG_CMAKE), (index, ""), (prefix / "lib/readme", "")):
        file.parent.mkdir(parents=True)
        file.write_text(text)
    ros = replace(real_ros, underlays=(prefix,))
    manifest = MANIFEST.replace("ament_python", "ament_cmake").replace("rclpy", "nav2_util")
    files = {"package.xml": manifest, "CMakeLists.txt": CMAKE, "bot.c": "int main() {return 0;}\n"}
    tree.write({f"{FOLDER}/{name}": text for name, text in files.items()})

    def built() -> Prepared:
        return prepare(tree.root, Preparation(ros=ros, cache=tmp_path / "cache"))

    found = built()
    cause = why_not_built(found.record, "bot_publisher")
    assert cause is not None and cause.status is Status.ERROR, found.record.build
    assert "missing or damaged on the machine" in cause.observed
    assert "sudo apt install --reinstall ros-jazzy-nav2-util" in cause.hint
    library = ["cc", "-shared", "-o", str(prefix / "lib/libnav2_util.so"), "-x", "c", "/dev/null"]
    subprocess.run(library, check=True)
    again = built().record.build
    assert again is not None and again.succeeded, again


@pytest.mark.ros
def test_a_failure_is_built_again_once_when_any_file_of_a_sourced_ros_changed(
    tree: Tree, real_ros: RosInstallation, tmp_path: Path
) -> None:
    prefix = tmp_path / "jazzy"
    (prefix / "share/rclcpp").mkdir(parents=True)
    ros = replace(real_ros, source="sourced", prefixes=(prefix,))
    tree.package({"setup.py": "import nothing_at_all\n"})

    def is_kept() -> bool:
        build = prepare(tree.root, Preparation(ros=ros, cache=tmp_path / "cache")).record.build
        assert build is not None and not build.succeeded
        return build.cached

    assert [is_kept(), is_kept()] == [False, True]
    (prefix / "share/rclcpp/readme").write_text("repaired")
    assert [is_kept(), is_kept()] == [False, True]
