"""What to do about the first error of a build: by the table, or any_build_error."""

from __future__ import annotations

import pytest

from grader.diagnosis.build_error import TABLE, BuildError, KnownError
from grader.diagnosis.explanation import cause_of, explanations
from grader.recording.submission import EMPTY, SourceError
from tests.checks.builder import package


def error(message: str, file: str = "src/bot_publisher/src/bot.cpp") -> BuildError:
    return BuildError(SourceError(file, 3, message), package(build_type="ament_cmake"))


@pytest.mark.parametrize(
    ("row", "example"), [(row, one) for row in TABLE.errors for one in row.examples]
)
def test_every_row_of_the_table_answers_for_its_examples(row: KnownError, example: str) -> None:
    symptom = error(example, file="src/bot_publisher/setup.py" if row.file == r"setup\.py$" else "")
    answer = next(one for one in explanations()[BuildError] if one.apply(symptom) is not None)
    assert answer.sentence == row.mistake
    assert "$" not in (row.hint_for(symptom) or "").replace("${PROJECT_NAME}", "")


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (
            "geometry_msgs/msg/twist.hpp: No such file or directory",
            "`ament_target_dependencies(<program> geometry_msgs)`, and package.xml `<depend>",
        ),
        ("'tf2/utils.h' file not found", "`find_package(tf2 REQUIRED)`"),
        ("drive.hpp: No such file or directory", "target_include_directories(<program> PRIVATE"),
        (
            'asked CMake to find a package configuration file provided by "geometri_msgs", but',
            "There is no package `geometri_msgs` here",
        ),
        ("undefined reference to `Bot::drive(double)'", "`Bot::drive(double)` is declared and"),
    ],
)
def test_what_is_missing_is_named_with_the_line_to_write(message: str, words: str) -> None:
    assert words in cause_of(error(message))


def test_an_exception_of_a_setup_py_is_no_error_of_a_compiler() -> None:
    symptom = error("ValueError: cannot convert float NaN", file="src/bot_publisher/setup.py")
    assert cause_of(symptom).startswith("Run `colcon build --packages-select bot_publisher`")


@pytest.mark.parametrize(
    "message",
    ["bot_publisher/bot.hpp: No such file or directory", "'bot_publisher/bot.hpp' file not found"],
)
def test_a_package_need_not_depend_on_itself_for_its_own_header(message: str) -> None:
    hint = cause_of(error(message))
    assert "lie in include/bot_publisher/" in hint and "find_package" not in hint
    assert explained_by(message) == "own_header"


@pytest.mark.parametrize(
    ("command", "package_of_it"),
    [
        ("rosidl_generate_interfaces", "rosidl_default_generators"),
        ("ament_auto_find_build_dependencies", "ament_cmake_auto"),
        ("rclcpp_components_register_node", "rclcpp_components"),
    ],
)
def test_the_package_that_has_a_command_is_named(command: str, package_of_it: str) -> None:
    message = f'Unknown CMake command "{command}".'
    assert f"`find_package({package_of_it} REQUIRED)`" in cause_of(error(message))
    assert explained_by(message) == "command_of_another_package"


def test_an_empty_file_is_to_be_handed_in_whole() -> None:
    assert "copied whole" in cause_of(error(EMPTY))
    assert explained_by(EMPTY) == "empty_file"


def explained_by(message: str) -> str:
    """The name of the explanation that answers."""
    return next(
        one.name for one in explanations()[BuildError] if one.apply(error(message)) is not None
    )
