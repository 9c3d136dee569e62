"""What to do about the first error of a build.

By header_not_found, package_not_found, undefined_reference, the table, any_build_error.
"""

from __future__ import annotations

import pytest

from grader.diagnosis.build_error import TABLE, BuildError, Row
from grader.diagnosis.explanation import cause_of, explanations
from grader.diagnosis.not_built import why_not_built
from grader.submission.record import BuildRecord, SourceError
from tests.checks.builder import package, submission

CMAKE = """\
project(bot_publisher)
find_package(ament_cmake REQUIRED)
find_package(rclcpp REQUIRED)
find_package(tf2 REQUIRED)
add_executable(bot_pub src/bot.cpp)
ament_target_dependencies(bot_pub rclcpp)
target_link_libraries(bot_pub tf2)
"""
FILES = ("src/bot_publisher/src/bot.cpp", "src/bot_publisher/include/bot_publisher/drive.hpp")
NO_FILE = "{}: No such file or directory"
NO_PACKAGE = 'asked CMake to find a package configuration file provided by "{}", but CMake did not'


def error(message: str, *more: str, file: str = "src/bot_publisher/src/bot.cpp") -> BuildError:
    record = package(build_type="ament_cmake", cmake=CMAKE)
    there = submission(record, files=(*FILES, *more))
    return BuildError(SourceError(file, 3, message), there, record)


@pytest.mark.parametrize(
    ("row", "example"), [(row, one) for row in TABLE.errors for one in row.examples]
)
def test_every_row_of_the_table_answers_for_its_examples(row: Row, example: str) -> None:
    symptom = error(example, file="src/bot_publisher/setup.py" if row.file == r"setup\.py$" else "")
    answer = next(one for one in explanations()[BuildError] if one.apply(symptom) is not None)
    assert answer.sentence == row.mistake
    assert "$" not in (row(symptom) or "").replace("${PROJECT_NAME}", "")


@pytest.mark.parametrize(
    ("message", "more", "words"),
    [
        (
            NO_FILE.format("geometry_msgs/msg/twist.hpp"),
            (),
            "Write `find_package(geometry_msgs REQUIRED)` and `ament_target_dependencies(bot_pub ",
        ),
        ("'geometry_msgs/msg/twist.hpp' file not found", (), "<depend>geometry_msgs</depend>"),
        (NO_FILE.format("tf2/utils.h"), (), "Write `ament_target_dependencies(bot_pub tf2)` in"),
        (NO_FILE.format("rclcpp/rclcpp.h"), (), '`#include "rclcpp/rclcpp.hpp"`'),
        (
            NO_FILE.format("bot_publisher/drive.hpp"),
            (),
            "target_include_directories(bot_pub PRIVATE include)",
        ),
        (
            NO_FILE.format("bot_publisher/driver.hpp"),
            (),
            "it has `include/bot_publisher/drive.hpp`",
        ),
        (NO_FILE.format("geometri_msgs/msg/twist.hpp"), (), "Did you mean `geometry_msgs`?"),
        (NO_PACKAGE.format("geometri_msgs"), (), "`find_package(geometry_msgs REQUIRED)`?"),
        (NO_PACKAGE.format("robot_of_mine"), (), "There is no package `robot_of_mine` here"),
        (
            "undefined reference to `Bot::drive(double)'",
            (),
            "`Bot::drive(double)` is declared and called",
        ),
        (
            "undefined reference to `drive()'",
            ("src/bot_publisher/src/b.cpp",),
            "`src/b.cpp` is not compiled",
        ),
        (
            "undefined reference to `rcutils_logging_initialize'",
            (),
            "It belongs to the package `rcutils`",
        ),
        (
            "undefined reference to `tf2::toMsg(int)'",
            (),
            "write `ament_target_dependencies(bot_pub tf2)`",
        ),
    ],
)
def test_what_is_missing_is_named_with_the_line_to_write(
    message: str, more: tuple[str, ...], words: str
) -> None:
    assert words in cause_of(error(message, *more))


def test_an_exception_of_a_setup_py_is_no_error_of_a_compiler() -> None:
    symptom = error("ValueError: cannot convert float NaN", file="src/bot_publisher/setup.py")
    assert cause_of(symptom).startswith("Run `colcon build --packages-select bot_publisher`")


def test_the_log_of_an_error_in_a_header_of_others_is_folded_to_the_students_line() -> None:
    log = """\
Starting >>> bot_publisher
-- Generating done
[ 50%] Building CXX object CMakeFiles/bot_pub.dir/src/bot.cpp.o
In file included from src/bot_publisher/src/bot.cpp:2:
/usr/include/c++/12/functional: In instantiation of ‘struct std::_Bind_check_arity<B*>’:
/usr/include/c++/12/functional:836:12:   required from ‘struct std::_Bind_helper<B*>’
src/bot_publisher/src/bot.cpp:16:83:   required from here
/usr/include/c++/12/functional:820:21: error: static assertion failed: Wrong number
  819 |       static_assert(_Varargs::value
Failed   <<< bot_publisher [1.0s, exited with code 2]
"""
    place = SourceError(
        "src/bot_publisher/src/bot.cpp", 16, "static assertion failed: Wrong number"
    )
    build = BuildRecord(False, 1.0, failed_packages=("bot_publisher",), culprit=place, log=log)
    cause = why_not_built(submission(build=build), "bot_publisher")
    assert cause is not None
    assert cause.evidence.log == (
        "src/bot_publisher/src/bot.cpp:16:83:   required from here",
        "/usr/include/c++/12/functional:820:21: error: static assertion failed: Wrong number",
    )
