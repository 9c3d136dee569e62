"""Which packages the C++ of a package needs."""

from __future__ import annotations

import pytest

from grader.submission.read.cmake import read_commands
from grader.submission.read.cpp_contents import outline
from grader.submission.read.includes import needed_files, read_included, with_own_headers

CMAKE = """\
find_package(ament_cmake REQUIRED)
find_package(rclcpp REQUIRED)
find_package(tf2)
add_library(drive src/drive.cpp)
add_executable(one src/one.cpp)
target_link_libraries(one PUBLIC drive nav_msgs::nav_msgs)
add_executable(two src/two.cpp)
ament_target_dependencies(two std_msgs)
if(BUILD_TESTING)
  find_package(sensor_msgs REQUIRED)
endif()
"""
ONE = """\
/* #include <std_msgs/msg/char.hpp>
*/
#include <memory>
#include <sys/types.h>
#include "bot/drive.hpp"  // #include "std_msgs/msg/bool.hpp"
#ifndef GUARD
#  include <rclcpp/rclcpp.hpp>
#endif
#if 0
#ifdef MORE
#include <sensor_msgs/msg/image.hpp>
#endif
#elif WITH_TF
#include <tf2/utils.h>
#endif
const char * text = "// no comment";
#include "geometry_msgs/msg/twist.hpp"
"""
FILES = {
    "src/one.cpp": ONE,
    "src/two.cpp": "int main() {}",
    "src/drive.cpp": '#include "drive.hpp"',
    "include/bot/drive.hpp": "#include <std_msgs/msg/string.hpp>",
    "test/test_bot.cpp": "#include <visualization_msgs/msg/marker.hpp>",
}
PACKAGES = "rclcpp std_msgs geometry_msgs sensor_msgs nav_msgs visualization_msgs tf2 ament_cmake"


def includes(files: dict[str, str]) -> dict[str, list[tuple[str, int, bool]]]:
    return {path: outline(text.encode())["includes"] for path, text in files.items()}


def included(cmake: str = CMAKE, files: dict[str, str] = FILES) -> set[str]:
    found = read_included(
        includes(files), cmake, "p/CMakeLists.txt", set(PACKAGES.split()).__contains__
    )
    return {
        f"{item.module}{'?' if item.optional else ''} {item.file}:{item.line}"
        for item in found.packages
    }


def test_what_is_included_looked_for_and_linked_is_needed() -> None:
    assert included() == {
        "rclcpp p/src/one.cpp:7",
        "tf2? p/src/one.cpp:14",
        "geometry_msgs p/src/one.cpp:17",
        "std_msgs p/include/bot/drive.hpp:1",
        "rclcpp p/CMakeLists.txt:2",
        "nav_msgs p/CMakeLists.txt:6",
        "std_msgs p/CMakeLists.txt:8",
    }


def test_a_package_that_compiles_nothing_is_judged_as_before() -> None:
    assert included("find_package(rclpy REQUIRED)\n") == set()


def test_a_header_of_a_package_of_that_name_may_be_its_own() -> None:
    assert (
        included(
            "add_executable(a a.cpp)", {"a.cpp": '#include "tf2/a.hpp"', "include/tf2/a.hpp": ""}
        )
        == set()
    )


def test_an_executable_needs_its_sources_their_libraries_and_headers() -> None:
    commands = read_commands(CMAKE)
    own = read_included(includes(FILES), CMAKE, "p/CMakeLists.txt", lambda _: False).own
    files, lines = needed_files("one", commands, "p/", own) or (set(), set())
    assert files >= {"p/src/one.cpp", "p/src/drive.cpp", "p/include/bot/drive.hpp"}
    assert "p/src/two.cpp" not in files and lines == {6}
    assert needed_files("script.py", commands, "p/", own) is None


@pytest.mark.parametrize(
    "cmake",
    [
        "add_executable(one ./src/one.cpp)",
        "add_executable(one ${CMAKE_CURRENT_SOURCE_DIR}/src/one.cpp)",
        "add_executable(one)\ntarget_sources(one PRIVATE src/one.cpp)",
    ],
)
def test_the_sources_of_an_executable_may_be_named_in_any_way(cmake: str) -> None:
    files, _ = needed_files("one", read_commands(cmake), "p/", ()) or (set(), set())
    assert "p/src/one.cpp" in files


def test_a_header_may_include_another_one() -> None:
    own = [("a.cpp", "a.hpp"), ("a.hpp", "b.hpp"), ("b.hpp", "a.hpp"), ("c.cpp", "c.hpp")]
    assert with_own_headers(["a.cpp"], own) == {"a.cpp", "a.hpp", "b.hpp"}


def test_an_endless_list_of_includes_is_cut() -> None:
    assert len(included(files={"a.cpp": "#include <tf2/a.h>\n" * 9000})) < 3000
