from __future__ import annotations

import ast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.recording.submission import SourceError
from grader.submission.read.source import MAX_BYTES, Allowance, parse


def error(data: bytes) -> SourceError:
    found = parse(data, "src/bot/node.py")
    assert isinstance(found, SourceError)
    assert found.file == "src/bot/node.py"
    assert "\n" not in found.message
    return found


def test_a_syntax_error_is_reported_in_python_s_words() -> None:
    found = error(b"import rclpy\ndef main(:\n    pass\n")
    assert (found.line, found.message) == (2, "SyntaxError: invalid syntax")
    assert error(b"def main():\npass\n").message.startswith("IndentationError: expected")


@pytest.mark.parametrize(
    "data",
    [
        b"\xef\xbb\xbfx = 1\n",
        b"# -*- coding: latin-1 -*-\nx = '\xe9'\n",
        "größe = 1\n".encode(),
        b"",
        b"x = '\\d'\n",
        b"x = 1\r\ny = 2\r\n",
    ],
)
def test_every_encoding_that_python_reads_is_read(data: bytes) -> None:
    assert isinstance(parse(data, "node.py"), ast.Module)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"a\0b", "null bytes"),
        (b"x = '\xe9'\n", "utf-8"),
        (b"# coding: klingon\n", "klingon"),
        (b"x = '\xe9'\n\xff", "utf-8"),
    ],
)
def test_bytes_that_are_no_source_are_an_error(data: bytes, message: str) -> None:
    assert message in error(data).message


@pytest.mark.parametrize(
    "data",
    [
        b"-" * 50_000 + b"1",
        b"1" + b"+1" * 200_000,
        b"a" + b".b" * 200_000,
        b"f" + b"()" * 200_000,
        b"not " * 50_000 + b"1",
        b"(" * 5_000 + b")" * 5_000,
    ],
)
def test_source_that_overflows_the_parser_is_an_error(data: bytes) -> None:
    error(data)


def test_giant_source_and_a_huge_tree_are_not_kept() -> None:
    assert "larger than 2 MiB" in error(b"#" * (MAX_BYTES + 1)).message
    assert "holds too much" in error(b"a," * (MAX_BYTES // 2)).message


def test_many_files_take_no_more_than_a_submission_may() -> None:
    allowance = Allowance(nodes=10_000)
    found = [parse(b"a," * 2000, f"{number}.py", allowance) for number in range(10)]
    assert [isinstance(item, ast.Module) for item in found] == [True] * 3 + [False] * 7
    assert "holds too much Python" in str(found[-1])


def test_a_string_that_is_no_text_can_be_written_down() -> None:
    tree = parse(b"x = 'gr\\xf6\\udc80', f'{x}\\ud800'", "node.py")
    assert isinstance(tree, ast.Module)
    values = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    assert sorted(values) == ["\\ud800", "gr\xf6\\udc80"]


@settings(deadline=None)
@given(st.binary(max_size=300))
def test_no_bytes_of_a_source_raise(data: bytes) -> None:
    assert isinstance(parse(data, "node.py"), (ast.Module, SourceError))
