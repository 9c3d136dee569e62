"""Hostile text is shown and never obeyed."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.spec.safe_text import clean, encodable, one_line


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x1b[0m", "red"),
        ("\x1b[2J\x1b[1;1Hall passed", "all passed"),
        ("\x1b]0;new title\x07text", "text"),
        ("\x1b]8;;https://example.org\x1b\\link\x1b]8;;\x1b\\", "link"),
        ("\x9b1mbold", "bold"),
        ("\x1bc", ""),
        ("no\x00thing", "no␀thing"),
        ("failed\rpassed", "failed␍passed"),
        ("back\x08space, \x7fdelete", "back␈space, ␡delete"),
        ("one\r\ntwo", "one\ntwo"),
        ("one\u2028two", "one\ntwo"),
        ("abc\u202edef", "abc<U+202E>def"),
        ("zero\u200bwidth", "zero<U+200B>width"),
        ("half \ud800 a pair", "half \ufffd a pair"),
        ("\x1b", "␛"),
        ("tab\tand Grüße, 日本, π ≈ 3", "tab\tand Grüße, 日本, π ≈ 3"),
    ],
)
def test_control_characters_never_reach_a_terminal(text, shown):
    assert clean(text) == shown


def test_an_escape_sequence_without_end_takes_only_its_line():
    assert clean("\x1b]0;title\nthe next line") == "\nthe next line"


def test_a_text_of_many_lines_becomes_one():
    assert one_line("first\n\n  second\tcolumn\r\n") == "first ⏎   second    column"


def test_encodable_keeps_everything_that_utf_8_can_hold():
    assert encodable("\x1b[31m\x00é\udcff") == "\x1b[31m\x00é\ufffd"


@given(st.text())
def test_nothing_that_a_terminal_obeys_is_left(text):
    left = {char for char in clean(text) if unicodedata.category(char) in ("Cc", "Cs")}
    assert left <= {"\n", "\t"}
    assert not set(clean(text)) & set("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
    clean(text).encode()


@given(st.text())
def test_cleaning_twice_changes_nothing_more(text):
    assert clean(clean(text)) == clean(text)


@given(st.text())
def test_one_line_is_one_line(text):
    assert len(one_line(text).splitlines()) <= 1
