"""What to do about the first error of a build: by the table, or any_build_error."""

from __future__ import annotations

import pytest

from grader.diagnosis.build_error import TABLE, BuildError, Row
from grader.diagnosis.explanation import cause_of, explanations
from grader.submission.record import SourceError
from tests.checks.builder import package


def error(message: str, file: str = "src/bot_publisher/src/bot.cpp") -> BuildError:
    return BuildError(SourceError(file, 3, message), package(build_type="ament_cmake"))


@pytest.mark.parametrize(
    ("row", "example"), [(row, one) for row in TABLE.errors for one in row.examples]
)
def test_every_row_of_the_table_answers_for_its_examples(row: Row, example: str) -> None:
    symptom = error(example, file="src/bot_publisher/setup.py" if row.file == r"setup\.py$" else "")
    answer = next(one for one in explanations()[BuildError] if one.apply(symptom) is not None)
    assert answer.sentence == row.mistake
    assert "$" not in (row(symptom) or "").replace("${PROJECT_NAME}", "")


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
