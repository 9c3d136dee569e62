from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.submission.read.cmake import CMakeCommand, read_commands


def arguments(text: str, name: str = "rosidl_generate_interfaces") -> tuple[str, ...]:
    return next(item.arguments for item in read_commands(text) if item.name == name)


def test_commands_have_names_in_lower_case_and_lines() -> None:
    text = "# a comment\nProject(bot)\n\nFIND_PACKAGE(ament_cmake\n  REQUIRED)\n"
    assert read_commands(text) == (
        CMakeCommand("project", ("bot",), 2),
        CMakeCommand("find_package", ("ament_cmake", "REQUIRED"), 4),
    )


@pytest.mark.parametrize(
    "text",
    [
        'rosidl_generate_interfaces(bot "msg/A.msg" "msg/B.msg")',
        "rosidl_generate_interfaces(bot msg/A.msg;msg/B.msg)",
        "rosidl_generate_interfaces( bot # the name\n\n  msg/A.msg\tmsg/B.msg\n)",
        "rosidl_generate_interfaces(bot [[msg/A.msg]] [=[msg/B.msg]=])",
        "rosidl_generate_interfaces (bot #[[ no ]] msg/A.msg msg/B.msg)\n#[[ open",
        'set(files "msg/A.msg" msg/B.msg)\nrosidl_generate_interfaces(bot ${files})',
        'set(files "msg/A.msg;msg/B.msg")\nrosidl_generate_interfaces(bot ${files})',
        "set(files msg/A.msg)\nlist(APPEND files msg/B.msg)\n"
        "rosidl_generate_interfaces(bot ${files})",
        "project(bot)\nset(dir msg)\n"
        "rosidl_generate_interfaces(${PROJECT_NAME} ${dir}/A.msg ${dir}/B.msg)",
    ],
)
def test_one_call_written_in_many_ways(text: str) -> None:
    assert arguments(text) == ("bot", "msg/A.msg", "msg/B.msg")


@pytest.mark.parametrize(
    "text",
    [
        "# rosidl_generate_interfaces(bot)",
        "#[[\nrosidl_generate_interfaces(bot)\n]]",
        'message("rosidl_generate_interfaces(bot)")',
    ],
)
def test_what_is_commented_out_or_quoted_is_no_command(text: str) -> None:
    assert not [item for item in read_commands(text) if item.name.startswith("rosidl")]


def test_an_unknown_variable_stays_as_it_is_written() -> None:
    assert arguments("rosidl_generate_interfaces(bot ${found})") == ("bot", "${found}")


def test_the_arguments_behind_a_keyword() -> None:
    command = CMakeCommand("f", ("bot", "DEPENDENCIES", "a", "b", "SKIP_INSTALL"), 1)
    keywords = frozenset({"DEPENDENCIES", "SKIP_INSTALL"})
    assert command.after("DEPENDENCIES", keywords) == ("a", "b")
    assert command.after("LIBRARY_NAME", keywords) is None


def test_a_list_made_of_itself_does_not_grow_for_ever() -> None:
    text = "set(a 12345678)\n" + 'set(a "${a}${a}")\n' * 60 + "f(${a})"
    assert len(arguments(text, "f")[0]) <= 10_000


@given(st.text(alphabet='a(#[=])"\\;\n ${}', max_size=200))
def test_no_text_makes_it_raise(text: str) -> None:
    for command in read_commands(text):
        assert 1 <= command.line <= text.count("\n") + 1
