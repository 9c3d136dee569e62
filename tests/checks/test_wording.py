"""Words that findings are made of."""

import math

import pytest

from grader.findings.words import codes, counted, listing, value_text


@pytest.mark.parametrize(
    ("items", "words"),
    [
        ([], ""),
        (["a"], "a"),
        (["a", "b"], "a and b"),
        (["a", "b", "c"], "a, b and c"),
        (["a", "b", "a"], "a and b"),
        ([str(n) for n in range(20)], "0, 1, 2, 3, 4, 5, 6, 7 and 12 more"),
    ],
)
def test_a_list_reads_as_a_sentence(items, words):
    assert listing(items) == words


def test_codes_with_another_last_word():
    assert codes(["a", "b"], last="or") == "`a` or `b`"


@pytest.mark.parametrize(
    ("number", "words"), [(0, "0 messages"), (1, "1 message"), (2, "2 messages")]
)
def test_a_number_and_its_noun_agree(number, words):
    assert counted(number, "message") == words


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.0, "1.0"),
        (0.1 + 0.2, "0.30000000000000004"),
        (math.nan, "nan"),
        (-math.inf, "-inf"),
        (3, "3"),
        (True, "true"),
        ("ready", "'ready'"),
        ([1.0, 2], "[1.0, 2]"),
        (list(range(9)), "[0, 1, 2, 3, 4, 5, 6, 7, ...]"),
    ],
)
def test_values_that_differ_look_different(value, text):
    assert value_text(value) == text


def test_a_long_text_is_shortened():
    assert value_text("x" * 500) == "'" + "x" * 119 + "..."
