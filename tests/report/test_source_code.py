"""Source code in a page: coloured, whole, and harmless."""

from __future__ import annotations

import time
from itertools import count

import pytest

from grader.report.html import source_code
from grader.report.html.source_code import LONGEST_LINE, code_lines


def shown(text: str, path: str = "node.py") -> str:
    return "\n".join(code_lines(path, text))


def test_every_line_of_the_file_is_a_line_of_the_page() -> None:
    text = 'a = 1\n\n"""Two\nlines."""\n\n\n'
    assert len(code_lines("node.py", text)) == 6
    assert len(code_lines("node.py", "")) == 1
    assert len(code_lines("node.py", "\n\nx")) == 3
    assert len(code_lines("notes", "a\u2028b\x85c\x0cd\n")) == 1


def test_code_is_coloured_by_its_language() -> None:
    assert '<span class="k">def</span> <span class="f">spin</span>' in shown("def spin(): ...\n")
    assert '<span class="c">// no</span>' in shown("// no", "src/node.cpp")
    assert shown("def spin(): ...", "notes") == "def spin(): ..."


def test_what_would_act_on_a_screen_is_shown_and_nothing_is_dropped() -> None:
    html = shown("x = '\u202eevil\u202c \x1b[31mred\x00\u200b \u2028'")
    for sign in ("202E", "202C", "200B", "2028", "001B", "0000"):
        assert f"<mark>U+{sign}</mark>" in html
    assert "</mark>[31mred<mark>" in html
    assert not set(html) & set("\u202e\u202c\x1b\x00\u200b\u2028")


def test_html_of_a_student_is_text() -> None:
    html = shown("x = '<script>alert(1)</script>' # </li><b>\n")
    assert "<script" not in html and "<b>" not in html and "</li>" not in html


def test_a_huge_line_is_cut_and_says_so() -> None:
    html = shown("# " + "x" * 250_000)
    assert len(html) < 2 * LONGEST_LINE
    assert "… 248002 more characters" in html


def test_a_text_that_takes_its_grammar_long_is_shown_whole_without_colours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(source_code, "MOST_S", 0.0)
    assert shown("def a(): ...\n\ndef b(): ...\n").endswith("\n\ndef b(): ...")


def test_a_busy_machine_takes_no_colours_away(monkeypatch: pytest.MonkeyPatch) -> None:
    colored = shown("def a(): ...\n\ndef b(): ...\n")
    monkeypatch.setattr(time, "monotonic", count(0.0, 60.0).__next__)
    assert shown("def a(): ...\n\ndef b(): ...\n") == colored
