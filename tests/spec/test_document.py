"""YAML is read as YAML 1.2, with the line of every value, and what is no YAML says where."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.errors import AssignmentError, UsageError
from grader.spec.document import path
from grader.spec.source import parse_source, read_source

FILE = Path("assignment.yaml")


def error(text: str) -> str:
    with pytest.raises(AssignmentError) as caught:
        parse_source(text, FILE)
    return str(caught.value)


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("on", "on"),
        ("No", "No"),
        ("12:30", "12:30"),
        ("2026-11-21", "2026-11-21"),
        ("1_000", "1_000"),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
        ("1e-3", 0.001),
        (".5", 0.5),
        ("1.", 1.0),
        ("-.inf", float("-inf")),
        ("true", True),
        ("False", False),
        ("~", None),
        ("", None),
        ("300 ms", "300 ms"),
        ("'true'", "true"),
        ("!!float 5", 5.0),
    ],
)
def test_scalars_are_those_of_yaml_1_2(written: str, meant: object) -> None:
    value = parse_source(f"key: {written}", FILE).data["key"]
    assert value == meant
    assert type(value) is type(meant)


def test_a_key_is_always_text() -> None:
    assert parse_source("on: 1\n3: 2\ntrue: 3\n~: 4", FILE).data == {
        "on": 1,
        "3": 2,
        "true": 3,
        "~": 4,
    }


# The key of a YAML entry has at most 1024 characters, and an escape takes up to twelve.
_key = st.text(max_size=80)
_json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text() | st.floats(allow_nan=False),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(_key, inner, max_size=3),
    max_leaves=15,
)


@given(st.dictionaries(_key, _json, max_size=4).filter(lambda data: "<<" not in str(data)))
def test_every_json_document_reads_as_itself(data: dict[str, object]) -> None:
    # Escapes that JSON and YAML write alike, and infinity as YAML writes it.
    text = json.dumps(data, ensure_ascii=True)
    if any(token in text for token in ("\\ud", "Infinity")):
        return
    assert parse_source(text, FILE).data == data


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused_in_words(text: str) -> None:
    try:
        parse_source(text, FILE)
    except AssignmentError as error:
        assert str(error).startswith("assignment.yaml")


def test_each_value_knows_its_line() -> None:
    source = parse_source("a: 1\nb:\n  - x\n  - c:\n      d: 2\n", FILE)
    assert source.line(("a",)) == 1
    assert source.line(("b",)) == 2
    assert source.line(("b", 0)) == 3
    assert source.line(("b", 1, "c", "d")) == 5
    assert source.line(("b", 1, "c", "not there")) == 4


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm(tmp_path: Path) -> None:
    file = tmp_path / "assignment.yaml"
    file.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: x\r\n")
    source = read_source(file)
    assert source.data == {"a": 1, "b": "x"}
    assert source.line(("b",)) == 2


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("a: 1\nb:\n\tc: 1", 3, "indent with spaces, not with tabs"),
        ("a: b: c", 1, "a text with ': ' in it needs quotes"),
        ("a:\n  - id: x\n   points: 1", 3, "does this line stand as far to the right"),
        (
            "a: 1\nb: 'x\nc: 1\n",
            2,
            "end of stream (is a comma, a bracket or a quote missing?)",
        ),
        ('a: 1\nb: "x\nc: 1\nd: "y z"\ne: 2\n', 4, "and is every quote before it closed?"),
        ("a: 1\nb: [1, 2\n", 2, "but got '<stream end>'"),
        ('a: "\\d+"', 1, "write a text with a backslash in single quotes, as in '\\d+'"),
        ("- a\nb: 1\n", 2, "does this line stand as far to the right as those that it belongs to,"),
        ("a: [1, 2\nb: 3\n", 2, "(is a comma, a bracket or a quote missing?)"),
        ("a: > 0", 1, "(a comparison needs quotes, as in '> 0')"),
        ("a: != 0", 1, "the tag != is not allowed here: a comparison needs quotes, as in '!= 0'"),
        ("a: 1\nb: @x", 2, "cannot start any token (a text that begins with it needs quotes)"),
        ("a: 1\n---\nb: 2", 2, "expected a single document"),
        ("a: *b", 1, "found undefined alias"),
        ("a: 1\nb: \x07", 2, "the control character U+0007"),
        ('a: "\\ud800"', 1, "cannot be read as !!str"),
        ('"\\ud800": 1', 1, "cannot be read as !!str"),
        ("a: 1\n\nb: 2\na: 3", 4, "the key 'a' stands twice (first in line 1)"),
        ("a: 1\n? [x, y]\n: 2", 2, "a key must be a plain word"),
        ("a: &x {b: 1}\nc:\n  <<: *x", 3, "c: merging (<<) is not part of YAML 1.2"),
        ("a: !!python/object:os.system x", 1, "tag !!python/object:os.system is not allowed"),
        ("a: !!binary aGk=", 1, "a: the tag !!binary is not allowed here"),
        ("a: !mine 1", 1, "a: the tag !mine is not allowed here"),
        ("a: !!int x", 1, "'x' cannot be read as !!int"),
        ("word", 1, "expected keys and values at the top"),
        ("", 1, "the file is empty"),
    ],
)
def test_what_cannot_be_read_says_where_and_why(text: str, line: int, said: str) -> None:
    message = error(text)
    assert message.startswith(f"assignment.yaml:{line}: ")
    assert said in message


@pytest.mark.skipif(
    not hasattr(sys, "set_int_max_str_digits"), reason="this Python reads integers of any length"
)
def test_an_integer_of_thousands_of_digits_says_where_and_why() -> None:
    message = error("a: " + "9" * 5000)
    assert message.startswith("assignment.yaml:1: ")
    assert "9999…' cannot be read as !!int" in message


@pytest.mark.parametrize("text", ["a: &a\n  - 1\n  - [*a]\n", "a: " + "[" * 3_000 + "]" * 3_000])
def test_endless_or_deep_nesting_is_refused(text: str) -> None:
    assert "nested too deeply (does an alias contain itself?)" in error(text)


def test_another_encoding_is_named_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "assignment.yaml"
    file.write_bytes("a: 1\nb: Größe\n".encode("latin-1"))
    with pytest.raises(AssignmentError, match=r"assignment\.yaml:2: not UTF-8 text"):
        read_source(file)


def test_a_missing_file_is_wrong_use_not_bad_yaml(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="No such file or directory"):
        read_source(tmp_path / "assignment.yaml")
    with pytest.raises(UsageError, match="Is a directory"):
        read_source(tmp_path)


def test_a_place_is_written_as_people_do() -> None:
    assert path(("checks", 2, "with", "period")) == "checks[2].with.period"
    assert path(()) == ""
